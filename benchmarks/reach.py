"""Makes docs/reach.md: what every built-in device can make, really planned.

    python benchmarks/reach.py [DEVICE...]

Names of devices measure those anew and keep the others as the page has them.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from chainsim import device_names, load_device
from dotwave.studies.reach import HEAD, ReachReport, reach_of

PAGE = Path(__file__).parents[1] / "docs" / "reach.md"
# The share that natural frequencies are spread by in the column of yields.
SPREAD = 0.003
START = """# What a device can make

```sh
dotwave reach --device linked-6x6
dotwave reach --device linked-6x6 --spread 0.01 --json
```

plans a few patterns of every kind on a device, each from rest, and says which are made: the longest way in, the
largest predicted error (of full scale), drive (of the amplifier's volts), deflection (of the softening well's edge) and
magnification of disturbances. `dw.reach("linked-6x6")` is the same in Python. With `--spread` the yield is told too: on
how many of 1,000 devices, whose natural frequencies differ so much, it is felt, when it is planned for that.

The map shows the waves of one level and one lag that can stand on a chain (`o`), whatever their way in; where actuators
are alone there is none, for any phases can be made.

A scene that cannot be made names the built-in devices that make such patterns.

The rest of this page is made by `python benchmarks/reach.py`, with a spread of 0.3 %{without}. Devices without
a section have not been measured yet.
"""


def section(report: ReachReport) -> str:
    """What was found of a device, in Markdown."""
    lines = [f"## {report.device}", "", f"| {' | '.join(HEAD)} |", "|" + "---|" * len(HEAD)]
    lines += [f"| {' | '.join(cells)} |" for cells in report.table()]
    if report.lacking():
        lines += ["", *(f"- {one}" for one in report.lacking())]
    if report.map_lines():
        lines += ["", "```text", *report.map_lines(), "```"]
    return "\n".join(lines) + "\n"


def main(names: list[str]) -> None:
    """Measure, and write the page."""
    old = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    kept = dict(re.findall(r"^## (\S+)\n(.*?)(?=^## |\Z)", old, flags=re.MULTILINE | re.DOTALL))
    parts = {}
    for name in device_names():
        if name in names:
            print(name, flush=True)
            # A thousand large devices take hours.
            spread = SPREAD if "40x96" not in name else None
            parts[name] = section(reach_of(load_device(name), spread))
        elif name in kept:
            parts[name] = f"## {name}\n{kept[name].rstrip()}\n"
        start = START.replace("{without}", " (but for `linked-40x96`; of carriers that swell no yield is planned for)")
        PAGE.write_text("\n".join([start, *parts.values()]), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:] or device_names())
