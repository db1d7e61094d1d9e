"""OpenCV's LSD beside the segments of Seafix: offsets from edges of known place."""

import math
import statistics
import time
from pathlib import Path

import cv2
import dataset as data
import numpy as np

SIZE, FOCAL, CENTRE, BASELINE, DISTANCE = (1024, 768), 500.0, (511.5, 383.5), 0.25, 3.0
BLUR, LEVELS = 0.8, (80.0, 140.0)
TURNS = [0.26 * i + 0.05 for i in range(24)]
GRAINS = [0.0, 1.0, 12.0]  # uniform noise of ± so many grey levels
# OpenCV shrinks the image to 0.8 of its size and scales the ends back about the first pixel's centre, not its corner. All ends
# are therefore too small by (1 / 0.8 − 1) / 2 px on both axes, which a user may add.
SHIFT = 0.125
SETTINGS = {
    "LSD": {},
    "LSD, shifted": {"shift": SHIFT},
    "LSD, shifted, advanced": {"shift": SHIFT, "refine": cv2.LSD_REFINE_ADV},
    "LSD, scale 1": {"scale": 1.0},
}
NEAR, PARALLEL, LENGTH = 1.5, math.radians(2), 30.0  # px, rad, px: segments that belong to a true edge
cv2.setNumThreads(1)


def half_points(a, b):
    """The middle of a segment ± 1/√3 of half its length: the places of the two independent offsets of a line fit."""
    middle, half = (a + b) / 2, (b - a) / 2 / math.sqrt(3)
    return np.array([middle - half, middle + half])


def lsd(image, shift=0.0, **settings):
    """LSD's segments as pairs of ends (px), and milliseconds."""
    detector = cv2.createLineSegmentDetector(**settings)
    start = time.perf_counter()
    found = detector.detect(image)[0]
    took = 1e3 * (time.perf_counter() - start)
    return (np.zeros((0, 2, 2)) if found is None else found.reshape(-1, 2, 2) + shift), took


def half_plane(turn, offset, grain, seed):
    """A bright half-plane, blurred, with noise, in 8 bits; its normal and distance from the first pixel's centre (px)."""
    normal = np.array([math.cos(turn), math.sin(turn)])
    distance = normal @ CENTRE + offset
    u, v = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    across = normal[0] * u + normal[1] * v - distance
    grid = np.linspace(-6, 6, 4801)
    lit = np.interp(across, grid, [0.5 * math.erfc(-x / (BLUR * math.sqrt(2))) for x in grid])
    noise = grain * np.random.default_rng(seed).uniform(-1, 1, lit.shape)
    return np.round(LEVELS[0] + (LEVELS[1] - LEVELS[0]) * lit + noise).astype(np.uint8), normal, distance


def pairs(grain):
    """Stereo pairs of half-planes three metres ahead: two of (image, normal, distance)."""
    for i, turn in enumerate(TURNS):
        offset = 50 * math.sin(i)
        shift = math.cos(turn) * FOCAL * BASELINE / DISTANCE
        yield [half_plane(turn, offset - side * shift, grain, 2 * i + side) for side in (0, 1)]


def drawn(folder, grain):
    """A data set of these pairs, so that Seafix measures the same images. Its object only lets Seafix look for edges."""
    folder.mkdir()
    frames, poses = ["stamp_ns,left,right"], []
    for i, pair in enumerate(pairs(grain)):
        for side, (image, _, _) in zip("LR", pair):
            cv2.imwrite(str(folder / f"{i:02}{side}.png"), image)
        frames.append(f"{10**9 * (i + 1)},{i:02}L.png,{i:02}R.png")
        poses.append(f"{i + 1}.0 0 0 0 0 0 0 1")
    (folder / "frames.csv").write_text("\n".join(frames) + "\n")
    for name in ("truth", "prior"):
        (folder / f"{name}.tum").write_text("\n".join(poses) + "\n")
    camera = f"size = {list(SIZE)}\nfx = {FOCAL}\nfy = {FOCAL}\ncx = {CENTRE[0]}\ncy = {CENTRE[1]}\ndistortion = []\n"
    (folder / "dataset.toml").write_text(
        'format = "seafix-dataset/1"\nname = "half_planes"\nlicence = "own"\nframes = "frames.csv"\nsite = "site.toml"\n'
        'truth = "truth.tum"\nprior = "prior.tum"\nprior_sigma = { position = 0.1, attitude_deg = 0.5 }\n'
        "[rig]\nrectified = true\n"
        f"right_from_left = [[1, 0, 0, {-BASELINE}], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
        f"[rig.left]\n{camera}[rig.right]\n{camera}"
    )
    corners = [[0, 0, 0], [0, -1, 0], [1, 0, 0], [1, -1, 0]]
    points = "".join(f'[[object.point]]\nid = "P{i}"\nat = {at}\nsigma = 0.001\n' for i, at in enumerate(corners))
    edges = "".join(
        f'[[object.edge]]\nid = "e{a}{b}"\nfrom = "P{a}"\nto = "P{b}"\nsigma = 0.001\n'
        for a, b in ((0, 1), (0, 2), (1, 3), (2, 3))
    )
    (folder / "site.toml").write_text(
        'format = "seafix-site/1.1"\nname = "half-planes"\naxes = "p1p3-x/p1p2xp1p3-z/zx-y"\nsite_frame = "square"\n'
        '[[object]]\nid = "square"\nbase = ["P0", "P1", "P2"]\n'
        f"base_in_world = [[0, 0, {DISTANCE}], [0, -1, {DISTANCE}], [1, 0, {DISTANCE}]]\nsurvey_sigma = 0.005\n"
        f"{points}{edges}"
    )
    return folder


def logged(run):
    """The half-points (px) of the lines that both cameras measured, and their stated standard deviations (px), as Seafix
    logs them: arrays n × 2 × 2 and n × 2 for each side, by frame."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    found = {}
    for file in sorted(Path(run).glob("*.mcap")):
        with file.open("rb") as log:
            reader = make_reader(log, decoder_factories=[DecoderFactory()])
            for message in reader.iter_decoded_messages(topics=["/referencing/frame"]):
                frame = message[3]
                lines = [[[o.u, o.v, o.sigma] for o in line.offsets] for line in frame.lines if len(line.offsets) == 4]
                both = np.array(lines, float).reshape(-1, 4, 3)
                found[frame.frame] = [(part[..., :2], part[..., 2]) for part in (both[:, :2], both[:, 2:])]
    return found


def summary(errors):
    errors = np.array(errors, float)
    if not len(errors):
        return "– | – | –"
    return f"{np.sqrt((errors**2).mean()):.4f} | {1.4826 * np.median(np.abs(errors)):.4f} | {np.abs(errors).max():.3f}"


def half_planes(seafix, folder):
    print("half-planes, offsets of the longest segment (px)\n")
    print("| noise (± grey levels) | | images with the edge | RMS | 1.48 × median | greatest | ms an image |")
    print("|---|---|---|---|---|---|---|")
    for grain in GRAINS:
        images = [one for pair in pairs(grain) for one in pair]
        for name, settings in SETTINGS.items():
            errors, found, times = [], 0, []
            for image, normal, distance in images:
                segments, took = lsd(image, **settings)
                times.append(took)
                segments = sorted(segments, key=lambda s: -np.linalg.norm(s[1] - s[0]))
                if segments and np.linalg.norm(segments[0][1] - segments[0][0]) > 200:
                    found += 1
                    errors.extend(half_points(*segments[0]) @ normal - distance)
            print(f"| {grain:g} | {name} | {found} of {len(images)} | {summary(errors)} | {statistics.median(times):.1f} |")
        if seafix:
            run = data.run(seafix, drawn(folder / f"drawn-{grain:g}", grain), folder / f"run-{grain:g}")
            errors, found, lines = [], 0, logged(run)
            for frame, sides in lines.items():
                for side in (0, 1):
                    _, normal, distance = images[2 * frame + side]
                    best = max(sides[side][0], key=lambda h: np.linalg.norm(h[1] - h[0]), default=None)
                    if best is not None:
                        found += 1
                        errors.extend(best @ normal - distance)
            print(f"| {grain:g} | Seafix | {found} of {len(images)} | {summary(errors)} | – |")


def projected(camera, pose, ends):
    """The part of an edge in the image, cut at 0.3 m before the camera; `None` outside."""
    a, b = (pose[:3, :3] @ end + pose[:3, 3] for end in ends)
    if min(a[2], b[2]) < 0.3:
        return None
    a, b = (np.array([camera["fx"] * p[0] / p[2] + camera["cx"], camera["fy"] * p[1] / p[2] + camera["cy"]]) for p in (a, b))
    low, high = 0.0, 1.0
    for axis, size in enumerate(camera["size"]):
        for sign, limit in ((1, size - 1.0), (-1, 0.0)):
            at, step = sign * a[axis], sign * (b - a)[axis]
            room = (limit if sign > 0 else 0.0) - at
            if step > 0:
                high = min(high, room / step)
            elif step < 0:
                low = max(low, room / step)
            elif room < 0:
                return None
    return (a + low * (b - a), a + high * (b - a)) if high > low else None


def belonging(edge, halves):
    """The longest segment that lies on the edge, and the errors (px) of its two offsets, or `None`."""
    if not len(halves):
        return None
    along = (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
    normal = np.array([-along[1], along[0]])
    off, place = (halves - edge[0]) @ normal, (halves - edge[0]) @ along
    step = halves[:, 1] - halves[:, 0]
    length = np.linalg.norm(step, axis=1)
    turn = np.abs(step @ normal) / np.maximum(length, 1e-9)
    inside = (place.min(1) > 0) & (place.max(1) < np.linalg.norm(edge[1] - edge[0]))
    fits = (np.abs(off).max(1) < NEAR) & (turn < math.sin(PARALLEL)) & inside & (length * math.sqrt(3) >= LENGTH / 2)
    longest = np.argmax(np.where(fits, length, -1))
    return (longest, off[longest]) if fits.any() else None


def edges_of(dataset, stamp):
    """The edges of all objects at the true pose, by side, that face the camera and are long enough in the image."""
    left = np.linalg.inv(dataset.truth[stamp])
    for side, shift in enumerate((np.eye(4), dataset.right_from_left)):
        for it in dataset.objects.values():
            pose = shift @ left @ it.true
            for number, ends in enumerate(it.edges):
                edge = projected(dataset.cameras[side], pose, ends) if data.facing(it, number, pose) else None
                if edge is not None and np.linalg.norm(edge[1] - edge[0]) >= LENGTH:
                    yield side, edge


def images(seafix, source, folder):
    dataset = data.Dataset(data.variant(source, folder / "data"))
    # The images have no calibration error: without its allowance the stated deviation is that of the fit.
    run = data.run(seafix, dataset.folder, folder / "run", "--set", "pipeline.triangulator.calibration-px=0")
    lines = logged(run)
    errors, stated, count = {name: {} for name in [*SETTINGS, "Seafix"]}, {}, 0
    times = {name: [] for name in SETTINGS}
    for number, frame in enumerate(dataset.frames):
        shot = [cv2.imread(str(dataset.folder / frame[side]), cv2.IMREAD_GRAYSCALE) for side in ("left", "right")]
        segments = {}
        for name, settings in SETTINGS.items():
            for side in (0, 1):
                found, took = lsd(shot[side], **settings)
                times[name].append(took)
                segments[name, side] = np.array([half_points(*s) for s in found]).reshape(-1, 2, 2)
        for side in (0, 1):
            segments["Seafix", side] = lines[number][side][0] if number in lines else np.zeros((0, 2, 2))
        for key, (side, edge) in enumerate(edges_of(dataset, int(frame["stamp_ns"]))):
            count += 1
            for name in errors:
                belongs = belonging(edge, segments[name, side])
                if belongs is not None:
                    errors[name][number, key] = belongs[1]
                    if name == "Seafix":
                        stated[number, key] = lines[number][side][1][belongs[0]]
    common = set.intersection(*(set(found) for found in errors.values()))
    print(f"\n{Path(source).resolve().name}: {2 * len(dataset.frames)} images, {count} edges in them, hidden ones included; ")
    print(f"{len(common)} found by all. Offsets of these in px:\n")
    print("| | edges found | RMS, common edges | 1.48 × median | greatest | ms an image |\n|---|---|---|---|---|---|")
    for name, found in errors.items():
        ms = f"{statistics.median(times[name]):.1f}" if name in times else "–"
        print(f"| {name} | {len(found)} | {summary([e for key in common for e in found[key]])} | {ms} |")
    for name, keys in (("common", common), ("all found", set(stated))):
        sigma = np.array([s for key in keys for s in stated[key]])
        ratio = np.array([e for key in keys for e in errors["Seafix"][key]]) / sigma
        print(f"\nSeafix, {name}: stated deviation {np.median(sigma):.4f} px (median of {len(sigma)} offsets); errors divided by it: ")
        print(f"{1.4826 * np.median(np.abs(ratio)):.3f} (1.48 × median), {100 * (np.abs(ratio) > 3).mean():.1f} % above 3")


def compare(seafix, sources, folder):
    half_planes(seafix, folder)
    for number, source in enumerate(sources):
        images(seafix, source, folder / str(number))
