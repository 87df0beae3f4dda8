from .channels import (
    Channel as Channel,
    Role as Role,
    channels_of as channels_of,
)
from .errors import (
    DriverError as DriverError,
    FileError as FileError,
    LimitError as LimitError,
    UnreadableWaveform as UnreadableWaveform,
    WaveformError as WaveformError,
)
from .exchange.file import (
    read_exchange as read_exchange,
    write_exchange as write_exchange,
)
from .files.locks import (
    held as held,
)
from .files.parts import (
    PartFile as PartFile,
    is_at as is_at,
    part_of as part_of,
    settle_alone as settle_alone,
)
from .files.whole import (
    atomic_file as atomic_file,
    atomic_files as atomic_files,
    made_folder as made_folder,
    naming as naming,
    settled as settled,
)
from .formats.samples import (
    SampleReader as SampleReader,
    SampleWriter as SampleWriter,
)
from .formats.table import (
    EXCHANGE_SUFFIXES as EXCHANGE_SUFFIXES,
    FORMATS as FORMATS,
    PACK_SUFFIX as PACK_SUFFIX,
    SUFFIXES as SUFFIXES,
    Format as Format,
    check_suffix as check_suffix,
)
from .formats.wav import (
    Encoding as Encoding,
    WavWriter as WavWriter,
)
from .formats.wav_reader import (
    WavReader as WavReader,
)
from .live.loop_line import (
    LoopLine as LoopLine,
)
from .live.messages import (
    LiveEnded as LiveEnded,
    LiveMessages as LiveMessages,
    LiveSource as LiveSource,
)
from .packs.reader import (
    NotInPack as NotInPack,
    Pack as Pack,
    PackEntry as PackEntry,
)
from .packs.writer import (
    PackedEntry as PackedEntry,
    PackWriter as PackWriter,
    write_pack as write_pack,
)
from .protocol.emulator import (
    Emulator as Emulator,
    EmulatorStatus as EmulatorStatus,
)
from .protocol.faults import (
    Faults as Faults,
    FaultWindow as FaultWindow,
    FaultyLine as FaultyLine,
)
from .protocol.felt import (
    FeltGrid as FeltGrid,
)
from .protocol.host_session import (
    ControllerRefused as ControllerRefused,
    HostSession as HostSession,
    SessionLost as SessionLost,
    StreamReport as StreamReport,
    Timing as Timing,
)
from .protocol.keys import (
    GridKey as GridKey,
    KeyEvent as KeyEvent,
)
from .protocol.outgoing import (
    UnfitController as UnfitController,
    session_messages as session_messages,
)
from .protocol.packet import (
    Kind as Kind,
    Packet as Packet,
    PacketReader as PacketReader,
)
from .protocol.plan_messages import (
    plan_messages as plan_messages,
)
from .protocol.plant_file import (
    PlantError as PlantError,
    PlantFile as PlantFile,
    read_plant as read_plant,
)
from .protocol.playout import (
    BUFFER_S as BUFFER_S,
    ControllerSpec as ControllerSpec,
)
from .protocol.pty_line import (
    PtyUnavailable as PtyUnavailable,
    make_link as make_link,
    open_pty as open_pty,
    remove_link as remove_link,
)
from .protocol.record import (
    ArrivalRecorder as ArrivalRecorder,
)
from .protocol.replies import Ack as Ack, Capabilities as Capabilities
from .protocol.virtual_controller import (
    VirtualController as VirtualController,
)
from .safety import (
    GateLimits as GateLimits,
    GateRefusal as GateRefusal,
    GateReport as GateReport,
    pass_gate as pass_gate,
)
from .sinks.audio import (
    AudioError as AudioError,
    AudioUnavailable as AudioUnavailable,
    parse_outputs as parse_outputs,
    play_audio as play_audio,
)
from .sinks.base import (
    Sink as Sink,
    SinkError as SinkError,
    SinkReport as SinkReport,
)
from .sinks.board_serial import (
    BOARD_BAUD as BOARD_BAUD,
    BoardEmulator as BoardEmulator,
    Firmware as Firmware,
    grid_line as grid_line,
    play_grid_lines as play_grid_lines,
)
from .sinks.drv2667 import (
    BoardRefusal as BoardRefusal,
)
from .sinks.opening import (
    SINKS as SINKS,
    Checked as Checked,
    OpenSink as OpenSink,
    open_sink as open_sink,
    sink_names as sink_names,
)
from .sinks.serial_play import (
    NoAnswer as NoAnswer,
    SerialLine as SerialLine,
    run_session as run_session,
)
from .sinks.tactile_board import (
    BoardPlan as BoardPlan,
    plan_board as plan_board,
)
from .sinks.uart import (
    LinkLost as LinkLost,
    PortUnavailable as PortUnavailable,
    SerialMissing as SerialMissing,
    Uart as Uart,
    serial_ports as serial_ports,
)
from .waveform.coupling import (
    CouplingEvent as CouplingEvent,
)
from .waveform.file import (
    WAVEFORMS_VERSION as WAVEFORMS_VERSION,
    WrittenWaveform as WrittenWaveform,
    read_waveform as read_waveform,
    write_waveform as write_waveform,
)
from .waveform.limits import (
    LimitCheck as LimitCheck,
)
from .waveform.manifest import (
    FrameMark as FrameMark,
    HeadingMark as HeadingMark,
    Manifest as Manifest,
)
from .waveform.manifest_reader import (
    read_manifest as read_manifest,
)
from .waveform.sampling import (
    Waveform as Waveform,
)
from .writing import (
    WrittenPlan as WrittenPlan,
    write_plan as write_plan,
)
