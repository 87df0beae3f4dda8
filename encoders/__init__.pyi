from .braille.back_check import (
    BackCheck as BackCheck,
    Difference as Difference,
    FeltPage as FeltPage,
    back_check as back_check,
    back_translate as back_translate,
)
from .braille.cell_grid import (
    CellGrid as CellGrid,
    are_cells as are_cells,
)
from .braille.dots import (
    bits_to_cell as bits_to_cell,
    cell_to_bits as cell_to_bits,
)
from .braille.joining import (
    covered_emphases as covered_emphases,
    covered_text as covered_text,
    emphases_of as emphases_of,
    emphases_within as emphases_within,
    join_pages as join_pages,
)
from .braille.louis_binding import (
    liblouis_place as liblouis_place,
    liblouis_version as liblouis_version,
)
from .braille.presentation import (
    read_cells as read_cells,
    read_page as read_page,
)
from .braille.readers.brf import (
    brf_to_cells as brf_to_cells,
    cells_to_brf as cells_to_brf,
)
from .braille.readers.formats import (
    READERS as READERS,
    Reader as Reader,
    text_suffixes as text_suffixes,
)
from .braille.readers.sources import (
    SourceKind as SourceKind,
    TextSource as TextSource,
)
from .braille.report import (
    EncodingReport as EncodingReport,
    Split as Split,
    UndefinedUse as UndefinedUse,
)
from .braille.table_queries import (
    TableInfo as TableInfo,
    list_tables as list_tables,
    recommended_tables as recommended_tables,
)
from .braille.tables import (
    foreign_tables as foreign_tables,
    resolve_tables as resolve_tables,
)
from .braille.text import (
    TextFrames as TextFrames,
    TextScene as TextScene,
    encode_text as encode_text,
)
from .braille.translation import (
    Translation as Translation,
    translate as translate,
)
from .choices import (
    EmphasisChoice as EmphasisChoice,
    Grade as Grade,
    ImageChoice as ImageChoice,
    LineEnds as LineEnds,
    Mathematics as Mathematics,
    PageNumbering as PageNumbering,
    Presentation as Presentation,
    TextOptions as TextOptions,
    Undefined as Undefined,
)
from .documents.flat import (
    BlockSpan as BlockSpan,
    FlatDocument as FlatDocument,
    ImageSpan as ImageSpan,
)
from .documents.model import (
    Block as Block,
    BlockKind as BlockKind,
    Document as Document,
    DocumentPlace as DocumentPlace,
    EmbeddedImage as EmbeddedImage,
    Emphasis as Emphasis,
    TextRun as TextRun,
)
from .errors import (
    DocumentsMissing as DocumentsMissing,
    EmptyText as EmptyText,
    EncodeError as EncodeError,
    InvalidText as InvalidText,
    LayoutError as LayoutError,
    LouisMissing as LouisMissing,
    TableMissing as TableMissing,
    UndefinedCharacter as UndefinedCharacter,
    UnsupportedSource as UnsupportedSource,
)
from .picture.errors import (
    PictureError as PictureError,
)
from .picture.figure import (
    Step as Step,
)
from .picture.limits import PictureLimits as PictureLimits
from .picture.margins import margins as margins
from .picture.options import (
    Fit as Fit,
    Invert as Invert,
    Output as Output,
    PictureOptions as PictureOptions,
    PictureRule as PictureRule,
    RegionsBy as RegionsBy,
    Style as Style,
    Threshold as Threshold,
    picture_rules as picture_rules,
)
from .picture.pictures import (
    PICTURES_VERSION as PICTURES_VERSION,
    PictureReport as PictureReport,
    PictureScene as PictureScene,
    encode_picture as encode_picture,
    explain_picture as explain_picture,
)
from .picture.similarity import (
    similarities as similarities,
)
from .scene import (
    SMOOTHNESS as SMOOTHNESS,
    STANDS_FROM as STANDS_FROM,
    Frame as Frame,
    GoesOn as GoesOn,
    GridShape as GridShape,
    Heading as Heading,
    PageNumber as PageNumber,
    PatternKind as PatternKind,
    Scene as Scene,
    TargetPattern as TargetPattern,
    UnlockedBeats as UnlockedBeats,
    WalkingBars as WalkingBars,
)
from .sets import (
    APART as APART,
    Choice as Choice,
    Distinctness as Distinctness,
    choose_distinct as choose_distinct,
    distinctness as distinctness,
    felt_codes as felt_codes,
    weakened as weakened,
)
from .textures import (
    Region as Region,
    TextureError as TextureError,
    bars as bars,
    levels as levels,
    plane_wave as plane_wave,
    regions as regions,
    rings as rings,
    slanted_bars as slanted_bars,
    unlocked as unlocked,
    walking_bars as walking_bars,
)
from .travel import (
    ArrowDirection as ArrowDirection,
    TravelFrames as TravelFrames,
    arrow as arrow,
    circle as circle,
    crossing as crossing,
    levels_at as levels_at,
    moving_dot as moving_dot,
    path as path,
    scrolled_bars as scrolled_bars,
)
