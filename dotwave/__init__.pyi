from .api.chains import (
    solve as solve,
    sweep as sweep,
)
from .api.felt import (
    Felt as Felt,
    verify as verify,
)
from .api.pictures import (
    icons as icons,
    image as image,
)
from .api.plans import (
    PlanWaveform as PlanWaveform,
    ScenePlan as ScenePlan,
    plan as plan,
)
from .api.reach import (
    reach as reach,
)
from .api.scenes import (
    device as device,
    job as job,
    text as text,
    texture as texture,
)
from .api.sinks import (
    Player as Player,
    open as open,
)
from .api.types import (
    Chain as Chain,
    ChainError as ChainError,
    Device as Device,
    DriverError as DriverError,
    EncodeError as EncodeError,
    FramePlan as FramePlan,
    Outcome as Outcome,
    PlanError as PlanError,
    Scene as Scene,
    Setting as Setting,
)
from .errors import (
    AppError as AppError,
    NotMade as NotMade,
)
from .live.live import (
    Live as Live,
)
