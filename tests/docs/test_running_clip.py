"""Chapter 14 and the page of the presets say what the records of the running clip say."""

from pages.book import presets, running_clip
from pages.store.marks import read_json, replaced

RECORD = read_json(running_clip.FILE, running_clip.COMMAND)


def test_the_chapter_has_the_table_of_the_record():
    text = running_clip.CHAPTER.read_text(encoding="utf-8")
    assert len(running_clip.MARKED.findall(text)) == 1
    assert running_clip.with_table(text, running_clip.table(RECORD)) == text


def test_another_record_makes_another_table():
    text = running_clip.CHAPTER.read_text(encoding="utf-8")
    run = RECORD["runs"][0]
    psnr = run["psnr"] | {"model": [value - 3 for value in run["psnr"]["model"]]}
    other = RECORD | {"runs": [run | {"psnr": psnr}]}
    assert running_clip.with_table(text, running_clip.table(other)) != text


def test_three_seeds_are_above_the_blend_and_level_with_flow():
    """So the chapter says, and that flow needs no model."""
    found = running_clip.means(RECORD)
    assert [run["seed"] for run in RECORD["runs"]] == [0, 1, 2]
    assert (found["model"] > found["two_neighbours"] + 2).all()
    assert (abs(found["model"] - found["flow_interpolation"]) < 0.1).all()


def test_the_page_of_the_presets_has_the_tables_of_the_records():
    text = presets.PAGE.read_text(encoding="utf-8")
    made = {"recorded": presets.recorded(), "simulated": presets.simulated()}
    assert replaced(text, made, presets.PAGE, "presets") == text
