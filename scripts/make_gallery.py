"""Runs the examples, prints a table of their run times and results, and refreshes the pictures.

    python scripts/make_gallery.py [PROGRAM ...] [--device cuda:0] [--no-pictures]
    python scripts/make_gallery.py --scenes [SCENE ...] [--device cuda:0]

The pictures of docs/gallery.md go to docs/gallery, at most 60 KB each. Programs run one after the
other in processes of their own; one that fails, or that lacks a library, is said so in its row.
`--scenes` draws the path-traced films of examples/scenes instead, minutes each on a CPU, and the
small copies that the README shows.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GALLERY = ROOT / "docs" / "gallery"
LIMIT = 60_000
# Program, options, and the picture that it writes, for a device.
PROGRAMS = (
    ("particles", ("--quick",), "fountain_{}.png"),
    ("ocean", (), "ocean_{}.png"),
    ("mesh_collision", (), "mesh_collision_{}.png"),
    ("rocks", (), "rocks_{}.png"),
    ("grains", ("--grains", "20000", "--steps", "60"), "grains_{}.png"),
    ("cloth", (), "cloth_{}.png"),
    ("trajectory", (), "trajectory_{}.png"),
    ("spring_rollout", ("--steps", "400"), "spring_rollout_{}.png"),
    ("several_devices", (), "several_devices.png"),
    ("fem/twist", (), "twist_{}.png"),
    ("fem/convergence", (), "convergence_{}.png"),
    ("fem/diffusion", (), "diffusion_{}.png"),
    ("fem/transport", (), "transport_{}.png"),
    ("fem/channel", (), "channel_{}.png"),
    ("fem/elasticity", (), "elasticity_{}.png"),
    ("fem/adaptive", (), "adaptive_{}.png"),
    ("fem/shape", (), "shape_{}.png"),
    ("fem/fluid", (), "fluid_{}.png"),
    ("fem/granular", (), "granular_{}.png"),
    ("tiles/image_network", (), "image_network_{}.png"),
    ("tiles/pendulum_chains", (), "pendulum_chains_{}.png"),
    ("tiles/galaxies", (), "galaxies_{}.png"),
    ("tiles/spectrum_filter", (), "spectrum_filter_{}.png"),
    ("torch_autograd", (), None),
    ("torch_particles", (), None),
    ("jax_wave", (), None),
)
# Films of examples/scenes; those without motion are pictures.
SCENES = ("ocean_sunset", "cloth_drape", "drum", "dusty_rocks")
SCENES += ("dam_break", "thrown_ball", "smoke", "soft_bodies")
# Bytes of a film or picture of a scene, and of its copy for the README; pixels of the latter.
FILM, SMALL, WIDTH = 1_000_000, 200_000, 400
# They use what devices there are.
WITHOUT_DEVICE = ("several_devices", "jax_wave")


def run(name, options, device, output, limit=300):
    """Seconds of the program, and the last line that it prints."""
    command = [sys.executable, str(ROOT / "examples" / f"{name}.py"), *options]
    if name not in WITHOUT_DEVICE:
        command += ["--device", device]
    if name not in ("torch_autograd", "torch_particles", "jax_wave"):
        command += ["--output", str(output)]
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ, timeout=limit)
    lines = [*(done.stdout if done.returncode == 0 else done.stderr).strip().splitlines(), ""]
    said = lines[-2] if len(lines) > 1 else ""
    return time.perf_counter() - start, said if done.returncode == 0 else f"failed: {said}"


def shrink(source, target):
    """A picture with few colours, made smaller until it has at most `LIMIT` bytes."""
    from PIL import Image

    picture = Image.open(source).convert("RGB")
    width = min(picture.width, 480)
    while True:
        scaled = picture.resize((width, picture.height * width // picture.width), Image.LANCZOS)
        scaled.quantize(96).save(target, optimize=True)
        if target.stat().st_size <= LIMIT:
            return
        width = width * 4 // 5


def publish(folder, name):
    """A scene's film, or its picture, and a small copy of some of its frames."""
    from PIL import Image, ImageSequence

    films, stills = sorted(folder.glob(f"{name}_*.webp")), sorted(folder.glob(f"{name}_*.png"))
    source = Image.open((films or stills)[0])
    if films and films[0].stat().st_size <= FILM:
        (GALLERY / f"{name}.webp").write_bytes(films[0].read_bytes())
    else:
        write_webp(GALLERY / f"{name}.webp", [source.convert("RGB")], 100, FILM)
    size = WIDTH, source.height * WIDTH // source.width
    frames = [
        frame.convert("RGB").resize(size, Image.BILINEAR)
        for number, frame in enumerate(ImageSequence.Iterator(source))
        if number % 2 == 0
    ]
    duration = 2 * source.info.get("duration", 100)
    write_webp(GALLERY / f"{name}_small.webp", frames, duration, SMALL)


def write_webp(path, frames, duration, limit):
    """Pictures as WebP, made coarser until they fit."""
    motion = {"save_all": True, "append_images": frames[1:], "loop": 0, "duration": duration}
    for quality in (78, 60, 40):
        frames[0].save(path, quality=quality, method=2, **(motion if len(frames) > 1 else {}))
        if path.stat().st_size <= limit:
            return


def draw_scenes(names, device, given):
    """Runs scenes, or takes what lies in a folder; prints the table of docs/gallery.md."""
    GALLERY.mkdir(exist_ok=True)
    print("| scene | seconds | last line |\n| --- | ---: | --- |", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in names or SCENES:
            if given:
                publish(given, name)
                continue
            took, said = run(f"scenes/{name}", (), device, Path(folder), None)
            print(f"| {name} | {took:.0f} | {said.replace('|', ';').strip('; ')} |", flush=True)
            publish(Path(folder), name)


def main(names, device, pictures):
    if pictures:
        GALLERY.mkdir(exist_ok=True)
    print("| program | seconds | last line |\n| --- | ---: | --- |", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for name, options, picture in PROGRAMS:
            if names and name not in names:
                continue
            took, said = run(name, options, device, Path(folder))
            print(f"| {name} | {took:.1f} | {said.replace('|', ';').strip('; ')} |", flush=True)
            if picture and pictures:
                made = Path(folder) / picture.format(device.replace(":", ""))
                shrink(made, GALLERY / f"{Path(name).name}.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("programs", nargs="*", help="names; all without any")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--no-pictures", action="store_true", help="times and results alone")
    parser.add_argument("--scenes", action="store_true", help="films of examples/scenes")
    parser.add_argument("--from", type=Path, dest="given", help="folder of films drawn before")
    options = parser.parse_args()
    if options.scenes:
        draw_scenes(options.programs, options.device, options.given)
        sys.exit()
    main(options.programs, options.device, not options.no_pictures)
