"""`task=convert` as a person uses it."""

from command_line import run_command
from test_convert import a_record, again, same_record

from tractexp.filetypes.tidy import write_record


def test_on_the_command_line(tmp_path):
    write_record(a_record(), tmp_path / "dip.csv")
    asked = (
        "task=convert",
        "task.to=parquet",
        "data=csv",
        "data.path=dip.csv",
        "model=auto",  # as the command has it that `look` proposes
        "hydra.run.dir=out",
    )
    done = run_command(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "there_dip2.parquet: 200 samples of t, U, P, Q, f, U2" in done.stdout
    same_record(a_record(), again(tmp_path / "out" / "there_dip2.parquet"))


def test_what_is_set_of_a_model_is_refused(tmp_path):
    write_record(a_record(), tmp_path / "dip.csv")
    asked = ("task=convert", "data=csv", "data.path=dip.csv", "model.bounds.C=[0.8,0.9]")
    done = run_command(*asked, cwd=tmp_path)
    assert done.returncode != 0
    assert "a conversion has no model" in done.stderr
