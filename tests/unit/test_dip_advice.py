"""Which further dip is advised, `advice`."""

from types import SimpleNamespace

from tractexp.identification import advice


def test_where_every_depth_would_do_any_dip_is_advised(monkeypatch):
    """Some of them are named by their depths."""
    known = SimpleNamespace(names=("M",), lower=[0.0], upper=[1.0], values=[0.5])
    monkeypatch.setattr(advice, "_find_goal", lambda *_: (0.1, []))
    told = [
        advice._describe_depths(
            known,
            0,
            [SimpleNamespace(half=[h], shape=SimpleNamespace(depth=d)) for h, d in plan],
            "more",
        )
        for plan in ([(0.05, 0.2), (0.05, 0.4)], [(0.5, 0.2), (0.05, 0.4)])
    ]
    assert [line.partition(" more")[0] for line in told] == [
        "for M: any further dip",
        "for M: a further dip of 40 %",
    ]
