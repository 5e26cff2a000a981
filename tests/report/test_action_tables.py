"""The tables of motions of action labels."""

from motionary.report.action_tables import action_tables
from motionary.report.document import render
from motionary.report.results import Results


def interval(mean):
    return {"mean": mean, "half": 0.01}


ROW = {"fid": interval(1.5), "accuracy": interval(0.75), "diversity": interval(6.0), "multimodality": interval(2.0)}
MEASURES = {"foot_skating": 0.1, "penetration": 0.01, "floating": 0.5, "jitter": 3.0, "bone_change": 0.002}


def results(found):
    return Results(stages={"scores": {"repetitions": 20, "action_generation": found}})


def test_every_kind_has_its_table():
    walk = {"real motions": ROW | {"foot_skating": interval(0.03)}, "model": ROW | {"foot_skating": interval(0.4)}}
    part = {"items": 12, "rows": {"real motions": ROW, "model": ROW | {"fid": interval(9.25)}}}
    found = {"coarse": part, "locomotion": {"walk": {"items": 5, "rows": walk}}, "physics": {"model": MEASURES}}
    coarse, locomotion, physics = action_tables(results(found))
    assert coarse.title == "Motions of coarse actions"
    assert coarse.rows[1] == ["model", "9.250 ± 0.010", "0.750 ± 0.010", "6.000 ± 0.010", "2.000 ± 0.010"]
    assert "12 real motions" in coarse.note
    assert "20 repetitions" in coarse.note
    assert locomotion.rows[1][-1] == "0.400 ± 0.010"
    assert locomotion.columns[-1].startswith("Foot skating")
    assert physics.rows[0][-1] == "2.000"
    assert "Motions of coarse actions" in render(results(found))


def test_nothing_scored_is_no_table():
    assert action_tables(results({})) == []
    assert action_tables(Results(stages={"scores": {"note": "no action"}})) == []
