"""What `tools/prices` measures: `stillray bench` in turns, and its medians as tables."""

import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

STILLRAY = "target/release/stillray"
OUT = Path("target/prices")
SHARED = Path("../shared/scenes")
ONLY = os.environ.get("ONLY", "")
BEFORE = os.environ.get("BEFORE", "")
COMMON = ["--size", "160x120", "--warmup", "2", "--quiet"]

BUILTIN = ["hairball", "terrain", "spheres", "bump", "text", "strands", "cornell", "penumbra", "skylight", "mist", "ashtray", "billiards", "furnace"]
MODELS = [
    "AlphaBlendModeTest/AlphaBlendModeTest.gltf",
    "CesiumMan/CesiumMan.glb",
    "FlightHelmet/FlightHelmet.gltf",
    "GlassVaseFlowers/GlassVaseFlowers.gltf",
    "LightsPunctualLamp/LightsPunctualLamp.gltf",
    "Sponza/Sponza.gltf",
]

# Which phases of a frame are told together.
GROUPS = {
    "place": ["upload", "reproject", "analyze", "survey", "gather", "generate", "retain", "append", "track"],
    "trace": ["verify"],
    "shadow": ["shadow"],
    "shade": ["shade"],
    "bounce": ["bounce"],
    "indirect": ["indirect", "accumulate"],
    "medium": ["medium"],
    "picture": ["reconstruct", "temporal", "resolve"],
}

# An effect: what is rendered without it and with it.
EFFECTS = [
    ("a lens", ["builtin:spheres"], ["builtin:spheres", "--aperture", "0.25", "--focus", "7"]),
    ("a square luminaire", ["builtin:penumbra?light=0"], ["builtin:penumbra"]),
    ("lamps that are meshes", ["builtin:penumbra?lamps=3"], ["builtin:penumbra?lamps=3", "--set", "emitters=8"]),
    ("light from a sky", ["builtin:penumbra"], ["builtin:penumbra", "--sky", "3"]),
    ("gloss", ["builtin:spheres"], ["builtin:spheres", "--set", "gloss=1"]),
    ("glass", ["builtin:ashtray", "--set", "path.depth=1"], ["builtin:ashtray", "--set", "path.depth=3"]),
    ("motion blur", ["builtin:billiards", "--shutter", "0"], ["builtin:billiards", "--shutter", "1"]),
    ("mist", ["builtin:mist?density=0"], ["builtin:mist"]),
    ("fog", ["builtin:cornell"], ["builtin:cornell", "--fog", "0.05"]),
    ("indirect light, 1 ray", ["builtin:cornell"], ["builtin:cornell", "--set", "indirect.depth=1"]),
    ("indirect light, 3 rays", ["builtin:cornell"], ["builtin:cornell", "--set", "indirect.depth=3"]),
]


def bench(arguments, methods="stable:1", frames=12, program=STILLRAY):
    """The methods of one run of `stillray bench`."""
    report = OUT / "bench.json"
    command = [program, "bench", *arguments, "--methods", methods, "--frames", str(frames), "--json", str(report), *COMMON]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"prices: {' '.join(command)}\n{done.stderr}")
    return json.loads(report.read_text())["methods"]


def phases(method):
    """Milliseconds of each group of phases, by its name; what no group has is `other`."""
    sums = dict.fromkeys([*GROUPS, "other"], 0.0)
    for phase in method["phases"]:
        group = next((name for name, labels in GROUPS.items() if phase["label"] in labels), "other")
        sums[group] += phase["ms"]["median"]
    return sums


def mib(method):
    return method["memory_bytes"] / 2**20


def row(cells):
    return "| " + " | ".join(cells) + " |\n"


def header(cells):
    return row(cells) + row(["---"] + ["---:"] * (len(cells) - 1))


def pruned():
    """Required against all, in turns within one run."""
    everything = OUT / "all.toml"
    everything.write_text('method = "stable"\ndensity = 1.0\nmodel = "all"\n')
    text = header(["scene", "required, ms", "all, ms", "ratio", "memory, MiB", *GROUPS, "other"])
    scenes = [(name, f"builtin:{name}") for name in BUILTIN]
    if SHARED.exists():
        scenes += [(path.split("/")[0], str(SHARED / path)) for path in MODELS]
    else:
        print(f"prices: models are skipped, no {SHARED}")
    for name, scene in scenes:
        if ONLY not in name:
            continue
        print(name, flush=True)
        required, all_ = bench([scene], f"stable:1,{everything}")
        ms = [method["total_ms"]["median"] for method in (required, all_)]
        parts = [phases(method) for method in (required, all_)]
        cells = [f"{parts[0][group]:.1f} → {parts[1][group]:.1f}" for group in [*GROUPS, "other"]]
        cells = [cell if cell != "0.0 → 0.0" else "" for cell in cells]
        memory = f"{mib(required):.2f} → {mib(all_):.2f}"
        text += row([name, f"{ms[0]:.1f}", f"{ms[1]:.1f}", f"{ms[1] / ms[0]:.2f}", memory, *cells])
    return text


def turns(first, second, rounds=3):
    """Of two benches that take turns the medians of ms, MiB and phases."""
    results = ([], [])
    for _ in range(rounds):
        for of, run in zip(results, (first, second)):
            of.append(run())
    middle = lambda of, part: statistics.median(part(method) for method in of)
    summary = lambda of: (
        middle(of, lambda m: m["total_ms"]["median"]),
        mib(of[0]),
        {group: middle(of, lambda m: phases(m)[group]) for group in phases(of[0])},
    )
    return [summary(of) for of in results]


def effects():
    text = header(["effect", "on", "without, ms", "with, ms", "ratio", "memory, MiB", "where"])
    for name, without, with_ in EFFECTS:
        if ONLY not in name:
            continue
        print(name, flush=True)
        (a, small, before), (b, big, after) = turns(lambda: bench(without)[0], lambda: bench(with_)[0])
        grown = sorted(((after[g] - before[g], g) for g in after), reverse=True)
        where = ", ".join(f"{g} {d:+.1f}" for d, g in grown[:3] if d > 0.02 * a)
        what = " ".join(with_).replace("builtin:", "").replace("--set ", "")
        text += row([name, f"`{what}`", f"{a:.1f}", f"{b:.1f}", f"{b / a:.2f}", f"{small:.2f} → {big:.2f}", where])
    return text


def nothing(rounds=12):
    """Against another build, in turns whose order turns, too. Other work on the machine only adds time: the smallest are the surest."""
    text = header(["scene", "before, ms", "now, ms", "smallest", "median of pairs", "quartiles", "memory, MiB"])
    for name in ["hairball", "terrain", "spheres", "cornell", "bump", "text"]:
        if ONLY not in name:
            continue
        print(name, flush=True)
        runs = {BEFORE: [], STILLRAY: []}
        for index in range(rounds):
            for program in (BEFORE, STILLRAY) if index % 2 == 0 else (STILLRAY, BEFORE):
                runs[program].append(bench([f"builtin:{name}"], frames=16, program=program)[0])
        before, now = runs[BEFORE], runs[STILLRAY]
        least = [min(method["total_ms"]["min"] for method in of) for of in (before, now)]
        ratios = [b["total_ms"]["median"] / a["total_ms"]["median"] for a, b in zip(before, now)]
        low, middle, high = statistics.quantiles(ratios, n=4)
        cells = [f"{least[0]:.1f}", f"{least[1]:.1f}", f"{least[1] / least[0]:.3f}", f"{middle:.3f}", f"{low:.3f} to {high:.3f}"]
        text += row([name, *cells, f"{mib(before[0]):.2f} → {mib(now[0]):.2f}"])
    return text


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    text = "160x120, density 1, stable samples, medians on the first device.\n\n## Modelled and not needed\n\n" + pruned()
    text += "\n## Effects that are used\n\n" + effects()
    if BEFORE:
        text += "\n## Scenes that use nothing, against " + BEFORE + "\n\n" + nothing()
    (OUT / "prices.md").write_text(text)
    print(f"\n{text}\nin {OUT / 'prices.md'}")


main()
