"""OpenCV and scikit-image as peers of the benches: one JSON request per line, one JSON answer per line.

Runs under CPython 3.7 with opencv-contrib 3.4.2 (the last with SURF) and under recent versions.
An array is {"shape": [...], "type": "f4" | "u1", "data": base64}. One thread.
"""

import base64
import json
import os
import sys
import time

import cv2
import numpy as np

cv2.setNumThreads(1)
KEPT = {}


def decode(array):
    data = np.frombuffer(base64.b64decode(array["data"]), dtype="<" + array["type"])
    return data.reshape(array["shape"]).copy()


def encode(array):
    array = np.ascontiguousarray(array)
    array = array if array.dtype == np.uint8 else array.astype("<f4")
    data = base64.b64encode(array.tobytes()).decode()
    return {"shape": list(array.shape), "type": "u1" if array.dtype == np.uint8 else "f4", "data": data}


def table(keypoints):
    """Rows of x, y, size, angle, response."""
    rows = [(k.pt[0], k.pt[1], k.size, k.angle, k.response) for k in keypoints]
    return np.array(rows, np.float32).reshape(len(rows), 5)


def keypoints(rows):
    return [cv2.KeyPoint(float(x), float(y), float(s), float(a), float(r)) for x, y, s, a, r in rows]


def corners(request):
    """Harris corners with OpenCV's defaults, at most the requested number."""
    image = KEPT[request["image"]]
    options = dict(blockSize=request.get("block", 3), useHarrisDetector=request.get("harris", True), k=0.04)
    quality, distance = request.get("quality", 1e-4), request.get("distance", 4)

    def run():
        return cv2.goodFeaturesToTrack(image, request["count"], quality, distance, **options)

    def rows(found):
        found = found.reshape(-1, 2)
        n = len(found)
        size = np.full(n, request.get("size", 11.25))
        rank = np.arange(n, 0, -1)
        return {"keypoints": encode(np.column_stack([found, size, np.full(n, -1), rank]))}

    return run, rows


SURFS = {}


def surf(request):
    """SURF with the threshold that gives the requested number of points; determined once per image, not timed."""
    key = (request["image"], request["count"])
    if key not in SURFS:
        image = KEPT[request["image"]]
        responses = [k.response for k in cv2.xfeatures2d.SURF_create(1.0, upright=True).detect(image, None)]
        responses.sort(reverse=True)
        SURFS[key] = responses[request["count"]] if len(responses) > request["count"] else 1.0
    return cv2.xfeatures2d.SURF_create(SURFS[key], upright=request["upright"])


def described(found):
    points, descriptors = found
    return {"keypoints": encode(table(points)), "descriptors": encode(descriptors)}


def features(request):
    """Detection and description by one of OpenCV's methods."""
    image, count, kind = KEPT[request["image"]], request["count"], request["kind"]
    if kind == "surf":
        method = surf(request)
    elif kind == "sift":
        method = cv2.SIFT_create(nfeatures=count)
    elif kind == "orb":
        method = cv2.ORB_create(nfeatures=count)
    return lambda: method.detectAndCompute(image, None), described


def fast(request):
    image, method = KEPT[request["image"]], cv2.FastFeatureDetector_create(request["threshold"])
    return lambda: method.detect(image, None), lambda found: {"keypoints": encode(table(found))}


def describe(request):
    """SURF at given key points; OpenCV keeps their order."""
    image, points = KEPT[request["image"]], keypoints(decode(request["keypoints"]))
    method = cv2.xfeatures2d.SURF_create(upright=request["upright"], extended=request.get("extended", False))
    return lambda: method.compute(image, points), described


def nearest_two(request):
    a, b = KEPT[request["a"]], KEPT[request["b"]]
    matcher = cv2.BFMatcher(cv2.NORM_L2)

    def rows(found):
        index = [[m.trainIdx for m in pair] for pair in found]
        distance = [[m.distance for m in pair] for pair in found]
        return {"index": encode(np.array(index)), "distance": encode(np.array(distance))}

    return lambda: matcher.knnMatch(a, b, k=2), rows


def lucas_kanade(request):
    left, right, points = KEPT["left"], KEPT["right"], decode(request["points"])
    guess = decode(request["guess"]) if "guess" in request else None
    options = dict(winSize=(request["window"],) * 2)
    if guess is not None:
        options.update(flags=cv2.OPTFLOW_USE_INITIAL_FLOW)

    def run():
        return cv2.calcOpticalFlowPyrLK(left, right, points, None if guess is None else guess.copy(), **options)

    return run, lambda found: {"points": encode(found[0]), "status": encode(found[1])}


def corner_sub_pix(request):
    image, points = KEPT[request["image"]], decode(request["points"])
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    half = (request["window"] // 2,) * 2
    return lambda: cv2.cornerSubPix(image, points.copy(), half, (-1, -1), criteria), lambda f: {"points": encode(f)}


def clahe(request):
    image, method = KEPT[request["image"]], cv2.createCLAHE(request["limit"], (8, 8))
    return lambda: method.apply(image), lambda found: {"image": encode(found)}


def pair(request):
    """Harris + SURF upright, matched both ways with the ratio test, refined by Lucas-Kanade, triangulated."""
    images = [KEPT["left"], KEPT["right"]]
    surf = cv2.xfeatures2d.SURF_create(upright=True)
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    projections = [decode(p) for p in request["projections"]]

    def run():
        points, vectors = [], []
        for image in images:
            found = cv2.goodFeaturesToTrack(image, request["count"], 1e-4, 4, useHarrisDetector=True, k=0.04)
            given = [cv2.KeyPoint(float(x), float(y), 11.25) for x, y in found.reshape(-1, 2)]
            given, described = surf.compute(image, given)
            points.append(np.array([k.pt for k in given], np.float32))
            vectors.append(described)
        there, back = (matcher.knnMatch(*v, k=2) for v in (vectors, vectors[::-1]))
        back = {m[0].queryIdx: m[0].trainIdx for m in back}
        good = [m for m, n in there if m.distance < 0.8 * n.distance and back[m.trainIdx] == m.queryIdx]
        left = points[0][[m.queryIdx for m in good]]
        right = points[1][[m.trainIdx for m in good]]
        flags = dict(winSize=(21, 21), flags=cv2.OPTFLOW_USE_INITIAL_FLOW)
        refined, status, _ = cv2.calcOpticalFlowPyrLK(*images, left, right.copy(), **flags)
        kept = status.ravel() == 1
        return cv2.triangulatePoints(*projections, left[kept].T, refined[kept].T)

    return run, lambda found: {"points": encode(found)}


def keep(request):
    KEPT[request["name"]] = decode(request["array"])
    for key in [key for key in SURFS if key[0] == request["name"]]:
        del SURFS[key]
    return {}


def photograph(request):
    """A photograph of scikit-image's wheel, grey, 8 bits; nothing is downloaded."""
    import skimage

    path = os.path.join(os.path.dirname(skimage.__file__), "data", request["name"])
    return {"image": encode(cv2.imread(path, cv2.IMREAD_GRAYSCALE))}


def picture(request):
    """An image from a file, grey, 8 bits."""
    return {"image": encode(cv2.imread(request["path"], cv2.IMREAD_GRAYSCALE))}


def calibrate(request):
    """Calibration of both cameras, then of the rig; rows of x, y, z, u left, v left, u right, v right. RMS in pixels."""
    boards = [decode(board) for board in request["boards"]]
    space, left, right = ([np.ascontiguousarray(b[:, i:j]) for b in boards] for i, j in [(0, 3), (3, 5), (5, 7)])
    size = tuple(request["size"])
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-9)
    rms_left, k1, d1 = cv2.calibrateCamera(space, left, size, None, None, criteria=criteria)[:3]
    rms_right, k2, d2 = cv2.calibrateCamera(space, right, size, None, None, criteria=criteria)[:3]
    rms, k1, d1, k2, d2, turn, step = cv2.stereoCalibrate(
        space, left, right, k1, d1, k2, d2, size, flags=cv2.CALIB_FIX_INTRINSIC, criteria=criteria)[:7]
    numbers = dict(K1=k1, D1=d1.ravel(), K2=k2, D2=d2.ravel(), R=turn, T=step.ravel())
    return dict({key: value.tolist() for key, value in numbers.items()}, left=rms_left, right=rms_right, stereo=rms)


def versions(_):
    return {"opencv": cv2.__version__, "python": sys.version.split()[0]}


TIMED = {f.__name__: f for f in [
    clahe, corner_sub_pix, corners, describe, fast, features, lucas_kanade, nearest_two, pair]}
PLAIN = {f.__name__: f for f in [calibrate, keep, photograph, picture, versions]}


def answer(request):
    if request["do"] in PLAIN:
        return PLAIN[request["do"]](request)
    run, rows = TIMED[request["do"]](request)
    found, spent = run(), []
    for _ in range(request.get("repeats", 0)):
        start = time.thread_time()
        found = run()
        spent.append(1e3 * (time.thread_time() - start))
    result = {} if spent else rows(found)
    result["ms"] = spent
    return result


for line in sys.stdin:
    try:
        reply = answer(json.loads(line))
    except Exception as error:  # reported to the bench, which prints it
        reply = {"error": "%s: %s" % (type(error).__name__, error)}
    print(json.dumps(reply), flush=True)
