"""A campaign of one group has no tick for it."""

from pathlib import Path

import pytest
from matplotlib.axes import Axes

from utank_hil.pictures.campaign import CampaignRun, draw_campaign


@pytest.mark.parametrize(("groups", "count"), [([""], 0), (["storm", "swell"], 2)])
def test_one_group_has_no_tick(
    groups: list[str], count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ticks: list[int] = []
    monkeypatch.setattr(Axes, "set_yticks", lambda self, at, names: ticks.append(len(at)))
    rolls = [0.01] * len(groups)
    run = CampaignRun("passive", rolls, rolls, [0.01, 0.02])
    draw_campaign(groups, "sea", [run], tmp_path / "campaign.png", "Campaign")
    assert ticks == [count]
