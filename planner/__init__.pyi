from .analysis.climbing import (
    climb as climb,
)
from .analysis.pareto import (
    ParetoError as ParetoError,
    ParetoFront as ParetoFront,
    ParetoPoint as ParetoPoint,
    front_of as front_of,
    pareto_of as pareto_of,
)
from .analysis.questions import (
    Question as Question,
    TradeoffError as TradeoffError,
    questions_of as questions_of,
    seconds_words as seconds_words,
)
from .analysis.reach import (
    KINDS as KINDS,
    ReachKind as ReachKind,
    ReachRow as ReachRow,
    WaveMap as WaveMap,
    reach_row as reach_row,
    wave_map as wave_map,
)
from .analysis.requirement import (
    Requirement as Requirement,
    RequirementError as RequirementError,
    Term as Term,
    require as require,
)
from .analysis.standing import standing_error as standing_error
from .analysis.tradeoff import (
    Tradeoff as Tradeoff,
    TradeoffChoice as TradeoffChoice,
    TradeoffRow as TradeoffRow,
    trade_off as trade_off,
)
from .cache import PLANS_VERSION as PLANS_VERSION
from .drive import (
    DriveTone as DriveTone,
    FirstOrderHold as FirstOrderHold,
    curve as curve,
    links_at as links_at,
    tones_of as tones_of,
)
from .errors import (
    CannotTravel as CannotTravel,
    ContrastError as ContrastError,
    DwellTooShort as DwellTooShort,
    PlanError as PlanError,
    SceneDoesNotFit as SceneDoesNotFit,
    YieldError as YieldError,
)
from .families import (
    made_at_will as made_at_will,
)
from .identification.adaptation import (
    Adaptation as Adaptation,
    AdaptationReport as AdaptationReport,
)
from .identification.bias_estimate import (
    BiasEstimate as BiasEstimate,
)
from .identification.calibration import (
    ChainFit as ChainFit,
    Sweep as Sweep,
    SweepError as SweepError,
    fit_chain as fit_chain,
)
from .identification.device_estimate import (
    DeviceEstimate as DeviceEstimate,
    EstimateError as EstimateError,
)
from .identification.measurement import (
    Measured as Measured,
)
from .identification.page_choice import (
    PageChoice as PageChoice,
    choose_pages as choose_pages,
    expected_error as expected_error,
)
from .identification.stages import (
    SensorNoise as SensorNoise,
)
from .live_plan import LivePlan as LivePlan, LiveWay as LiveWay
from .operating_point import (
    Margins as Margins,
    OperatingPoint as OperatingPoint,
    PointTone as PointTone,
)
from .outlook import (
    FrameSpread as FrameSpread,
    MeansTried as MeansTried,
    TradePoint as TradePoint,
    needed_for as needed_for,
    spread_words as spread_words,
)
from .plan import (
    AMPLITUDE_ERROR_LIMIT as AMPLITUDE_ERROR_LIMIT,
    FramePlan as FramePlan,
    Plan as Plan,
    Ramp as Ramp,
    ToneRamp as ToneRamp,
)
from .robustness.robust import (
    Accuracy as Accuracy,
    RobustError as RobustError,
    RobustPlan as RobustPlan,
    TradeRow as TradeRow,
    Trial as Trial,
    accuracy_needed as accuracy_needed,
    robust_plan as robust_plan,
)
from .robustness.spread import (
    FrameTarget as FrameTarget,
    RelativeSpread as RelativeSpread,
    SpreadError as SpreadError,
    SpreadReport as SpreadReport,
    frame_target as frame_target,
    spread_of as spread_of,
)
from .scene_plan import (
    DEFAULT_CONTRAST_DB as DEFAULT_CONTRAST_DB,
    kept_share as kept_share,
    plan_scene as plan_scene,
)
from .travel import (
    quickest_travel as quickest_travel,
)
from .waves.beats import (
    beats_of as beats_of,
    beats_off as beats_off,
)
from .waves.walking import (
    walking_rate_hz as walking_rate_hz,
)
from .wish import (
    CONTRAST_LIMIT_DB as CONTRAST_LIMIT_DB,
    DOT_THRESHOLD as DOT_THRESHOLD,
    FrameVerdict as FrameVerdict,
    FrameWish as FrameWish,
)
