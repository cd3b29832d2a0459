"""Networks built by SUMO's own programs: a grid with lights, a ring with arms, a motorway with ramps, an old town."""

from __future__ import annotations

import subprocess
from pathlib import Path


def build(kind: str, folder: Path) -> Path:
    """Write a network and return its `.sumocfg`; its route file holds two vTypes and no vehicles."""
    import sumo

    folder.mkdir(parents=True, exist_ok=True)
    programs, net = Path(sumo.SUMO_HOME) / "bin", folder / "net.net.xml"
    if kind == "motorway":
        command = _motorway(programs, folder)
    else:
        command = [str(programs / "netgenerate"), *_GENERATED[kind], "--no-turnarounds", "--seed", "11"]
    subprocess.run([*command, "-o", str(net)], check=True, capture_output=True)
    (folder / "types.rou.xml").write_text(
        '<routes><vType id="car" vClass="passenger" speedFactor="normc(1,0.08,0.6,1.5)"/>'
        '<vType id="truck" vClass="truck" length="9" speedFactor="normc(0.95,0.05,0.6,1.3)"/></routes>'
    )
    config = folder / "town.sumocfg"
    config.write_text(
        '<configuration><net-file value="net.net.xml"/><route-files value="types.rou.xml"/></configuration>'
    )
    return config


_GENERATED = {
    "grid": [
        *("--grid", "--grid.number", "4", "--grid.length", "200", "--default.lanenumber", "2"),
        *("--tls.guess", "--tls.default-type", "static", "--default.speed", "13.89", "--grid.attach-length", "150"),
    ],
    "ring": [
        *("--spider", "--spider.omit-center", "--spider.arm-number", "6", "--spider.circle-number", "2"),
        *("--spider.space-radius", "130", "--spider.attach-length", "150", "--default.lanenumber", "1"),
        *("--default.speed", "13.89", "--default-junction-type", "priority"),
    ],
    "town": [
        *("--rand", "--rand.iterations", "45", "--rand.min-distance", "110", "--rand.max-distance", "260"),
        *("--default.lanenumber", "2", "--random-lanenumber", "--random-priority", "--tls.guess"),
        *("--tls.default-type", "static", "--default.speed", "13.89", "--rand.grid"),
    ],
}


def _motorway(programs: Path, folder: Path) -> list[str]:
    nodes = {"a": (0, 0), "b": (700, 0), "c": (1100, 0), "d": (1900, 0), "r": (400, -160), "s": (1500, -160)}
    edges = (
        ("ab", "a", "b", 2, 30.0, 9),
        ("bc", "b", "c", 3, 30.0, 9),
        ("cd", "c", "d", 2, 30.0, 9),
        ("rb", "r", "b", 1, 20.0, 3),
        ("cs", "c", "s", 1, 20.0, 3),
    )
    lines = [f'<node id="{name}" x="{x}" y="{y}"/>' for name, (x, y) in nodes.items()]
    (folder / "m.nod.xml").write_text(f"<nodes>{''.join(lines)}</nodes>")
    lines = [
        f'<edge id="{name}" from="{a}" to="{b}" numLanes="{lanes}" speed="{speed}" priority="{rank}"/>'
        for name, a, b, lanes, speed, rank in edges
    ]
    (folder / "m.edg.xml").write_text(f"<edges>{''.join(lines)}</edges>")
    files = ["-n", str(folder / "m.nod.xml"), "-e", str(folder / "m.edg.xml")]
    return [str(programs / "netconvert"), *files, "--no-turnarounds"]
