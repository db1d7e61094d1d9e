"""Writes seafix.rbl, the Rerun blueprint of a log: `pip install rerun-sdk`, then `python blueprint.py`."""

from pathlib import Path

import rerun.blueprint as rrb

# The topics of a log are the entity paths of Rerun.
blueprint = rrb.Blueprint(
    rrb.Horizontal(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Spatial2DView(
                    name="Left: key points, candidates, identified points",
                    origin="/camera/left",
                    contents=["$origin/image", "$origin/annotations"],
                ),
                rrb.Spatial2DView(
                    name="Right",
                    origin="/camera/right",
                    contents=["$origin/image", "$origin/annotations"],
                ),
            ),
            rrb.DataframeView(name="Result", origin="/referencing/result"),
            row_shares=[3, 2],
        ),
        rrb.Spatial3DView(
            name="Site, cloud and vehicle",
            origin="/",
            contents=["/model", "/scene/model", "/cloud/**", "/pose/**", "/tf"],
        ),
        column_shares=[3, 2],
    ),
    rrb.TimePanel(state="collapsed"),
)

blueprint.save("seafix", Path(__file__).parent / "seafix.rbl")
