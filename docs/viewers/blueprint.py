"""Writes seafix.rbl, the Rerun blueprint of a log: `pip install rerun-sdk`, then `python blueprint.py`."""

from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

# The topics of a log are the entity paths of Rerun. The application id is that of `seafix view`.
APPLICATION = "seafix"
TIMELINE = "message_log_time"


def dots(pixels):
    """Points of a diameter on the screen."""
    return rr.Points3D.from_fields(radii=-pixels).visualizer()


def path(pixels):
    """Points of all frames up to the cursor."""
    start, end = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    return [dots(pixels), rrb.VisibleTimeRanges([rrb.VisibleTimeRange(TIMELINE, start=start, end=end)])]


# What lies in the frame of the left camera is projected into both images.
SEEN = {
    "/cloud/candidates": dots(2.0),
    "/cloud/identified": dots(4.0),
    "/cloud/lines": dots(0.7),
    "/cloud/gates": dots(0.7),
}
PLACED = {
    **SEEN,
    "/cloud": dots(1.0),
    "/model": dots(3.0),
    "/model/edges": dots(1.0),
    "/pose/covariance": dots(0.8),
    "/path/estimate": path(3.0),
    "/path/truth": path(3.0),
}


def image(name, origin, calibration):
    """One image with what was found in it."""
    return rrb.Spatial2DView(name=name, origin=origin, contents=["$origin", calibration, *SEEN], overrides=SEEN)


blueprint = rrb.Blueprint(
    rrb.Horizontal(
        rrb.Vertical(
            rrb.Horizontal(
                image("Left", "/camera/left/image", "/camera/left/calibration"),
                image("Right", "/camera/right/image", "/camera/right/calibration"),
            ),
            rrb.DataframeView(name="Result", origin="/referencing/result"),
            row_shares=[3, 2],
        ),
        rrb.Spatial3DView(
            name="Site, gates, fix and path, about the vehicle",
            origin="/",
            contents=["/model/**", "/cloud/**", "/pose/**", "/path/**", "/tf"],
            overrides=PLACED,
            spatial_information=rrb.SpatialInformation(target_frame="auv"),
            # Behind and above the vehicle, whose third axis points down.
            eye_controls=rrb.EyeControls3D(
                kind="Orbital", position=(-5.0, -3.5, -2.5), look_target=(0.5, 0.0, 2.0), eye_up=(0.0, 0.0, -1.0)
            ),
        ),
        column_shares=[3, 2],
    ),
    rrb.TimePanel(state="collapsed", timeline=TIMELINE),
    collapse_panels=True,
)

blueprint.save(APPLICATION, Path(__file__).parent / "seafix.rbl")
