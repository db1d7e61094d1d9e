"""The layout for Foxglove has panels and settings of Foxglove's SDK."""

import dataclasses
import json
import pathlib

import pytest

LAYOUT = pathlib.Path(__file__).parents[2] / "docs" / "viewers" / "foxglove.json"
# A title is a setting of every panel, which the SDK writes beside the panel.
TITLE = {"foxglovePanelTitle"}


def settings(kind):
    """The keys that a class of the SDK writes."""
    fields = [field for field in dataclasses.fields(kind) if field.default is dataclasses.MISSING]
    return set(kind(**{field.name: None for field in fields})._to_dict()) | TITLE


def panels(tree):
    """The panels in a tree of splits."""
    if isinstance(tree, str):
        return [tree]
    assert set(tree) == {"direction", "first", "second", "splitPercentage"} and tree["direction"] in ("row", "column")
    return panels(tree["first"]) + panels(tree["second"])


def test_the_layout_has_settings_of_foxglove():
    """Seen to fail with `axisScale` in the transforms, which Foxglove calls `axisSize`."""
    sdk = pytest.importorskip("foxglove.layouts")
    layout = json.loads(LAYOUT.read_text())
    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    configs = layout["configById"]
    assert sorted(panels(layout["layout"])) == sorted(configs)
    kinds = {"Image": sdk.ImageConfig, "3D": sdk.ThreeDeeConfig, "Plot": sdk.PlotConfig, "RawMessages": sdk.RawMessagesConfig}
    for name, config in configs.items():
        assert set(config) <= settings(kinds[name.split("!")[0]]), name
        assert set(config.get("imageMode", {})) <= settings(sdk.ImageModeConfig), name
        assert all(set(path) <= settings(sdk.PlotSeries) for path in config.get("paths", [])), name
        scene = config.get("scene", {})
        assert set(scene) <= settings(sdk.BaseRendererSceneSettings), name
        assert set(scene.get("transforms", {})) <= settings(sdk.BaseRendererTransforms), name
        for topic, shown in config.get("topics", {}).items():
            pose = topic in ("/pose/estimate", "/pose/truth", "/pose/prior")
            scene = topic == "/scene/model"
            kind = sdk.BaseRendererPoseTopicSettings if pose else sdk.BaseRendererPointCloudTopicSettings
            assert set(shown) <= settings(sdk.BaseRendererSceneUpdateTopicSettings if scene else kind), topic
