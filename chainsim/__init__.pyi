from .averaging.decide import (
    Decision as Decision,
    decide as decide,
)
from .averaging.envelope import (
    follow as follow,
)
from .batch.sweep import (
    SweepResult as SweepResult,
    sweep as sweep,
    unit_of as unit_of,
)
from .complaints import (
    complaint_of as complaint_of,
    shown as shown,
    words_of as words_of,
)
from .continuation.path import (
    continue_branch as continue_branch,
)
from .continuation.spectrum import (
    critical_lam as critical_lam,
    delta_from_critical_lam as delta_from_critical_lam,
    gain_per_stage as gain_per_stage,
    peak_gain as peak_gain,
    rest_eigenvalues as rest_eigenvalues,
    spectrum_curve as spectrum_curve,
)
from .drawn.acting import (
    CommonAmplifier as CommonAmplifier,
)
from .drawn.devices import (
    DrawnDevices as DrawnDevices,
)
from .effects.effects import (
    AmplifierDynamics as AmplifierDynamics,
    BoucWen as BoucWen,
    Creep as Creep,
    Mode as Mode,
    Play as Play,
    Terms as Terms,
    Tone as Tone,
    bending_modes as bending_modes,
    modulated as modulated,
)
from .effects.ode import (
    integrate_terms as integrate_terms,
)
from .effects.rungs import (
    solve_with_terms as solve_with_terms,
)
from .effects.sampled import (
    SampledGrid as SampledGrid,
)
from .effects.steady import (
    Steady as Steady,
    steady_with_terms as steady_with_terms,
)
from .effects.tones import (
    two_tones as two_tones,
)
from .equations.chain import (
    Chain as Chain,
    Setting as Setting,
    Spread as Spread,
)
from .equations.coupling import (
    Closure as Closure,
    CouplingKind as CouplingKind,
)
from .errors import (
    ChainError as ChainError,
    ProfileError as ProfileError,
)
from .files.effects_section import (
    CreepSection as CreepSection,
    HysteresisSection as HysteresisSection,
)
from .files.simulation import (
    Simulation as Simulation,
    parse_simulation as parse_simulation,
    read_simulation as read_simulation,
    simulate as simulate,
)
from .files.sweep import (
    SettingSweep as SettingSweep,
    read_sweep as read_sweep,
)
from .harmonic_balance.joint_branches import (
    Branches as Branches,
    joint_branches as joint_branches,
)
from .harmonic_balance.rung import (
    balance_near as balance_near,
)
from .harmonic_balance.sensitivity import (
    Gradient as Gradient,
    gradient as gradient,
)
from .model.assumed import (
    assumed_of as assumed_of,
    surroundings_of as surroundings_of,
)
from .model.calibrated import (
    Actuator as Actuator,
    ActuatorSpread as ActuatorSpread,
    PlusMinus as PlusMinus,
)
from .model.device import (
    Amplifier as Amplifier,
    Coupling as Coupling,
    Device as Device,
    Modulation as Modulation,
    Note as Note,
    Span as Span,
    device_names as device_names,
    load_device as load_device,
)
from .model.parts import (
    HigherMode as HigherMode,
    Surroundings as Surroundings,
)
from .model.response import (
    Branch as Branch,
    Outcome as Outcome,
    Response as Response,
    Stats as Stats,
)
from .model.skin import (
    beats_of as beats_of,
    felt_modulation as felt_modulation,
    sideband_gain as sideband_gain,
    skin_gain as skin_gain,
)
from .npy_header import (
    NpyHeader as NpyHeader,
    read_npy_header as read_npy_header,
)
from .npz_file import opened_npz as opened_npz
from .reach.ladder import (
    solve as solve,
)
from .reading import first_bytes as first_bytes
from .rung import (
    DEFLECTION as DEFLECTION,
    RUNGS as RUNGS,
    TERMS as TERMS,
    VIBRATION as VIBRATION,
    Rung as Rung,
    RungError as RungError,
    Start as Start,
    load_rung as load_rung,
)
from .time_domain.as_built import (
    AsBuilt as AsBuilt,
)
from .time_domain.integrate import (
    Escape as Escape,
    GridError as GridError,
    GridIntegrator as GridIntegrator,
)
from .time_domain.ode import (
    Reached as Reached,
    reached_from_rest as reached_from_rest,
    steady_from_ramp as steady_from_ramp,
    steady_from_rest as steady_from_rest,
)
from .yamlfile import (
    Located as Located,
    parse_model as parse_model,
    read_located as read_located,
    read_model as read_model,
)
