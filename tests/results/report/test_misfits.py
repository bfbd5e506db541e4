"""Training frames that the model fits much worse than the others."""

from endotsr.results.report.misfits import MOST, misfits, misfits_html


def log_of(frames=8, visits=10, changes=None):
    """A log in which every frame is visited in turn; `changes`: (frame, term) -> factor."""
    usual, changes = {"l1": 0.01, "ssim": 0.9, "depth": 0.02}, changes or {}
    log = []
    for step in range(frames * visits):
        entry = {"iteration": step + 1, "frame": step % frames, "loss": 0.1, "gaussians": 9}
        for term, value in usual.items():
            factor = changes.get((step % frames, term), 1.0)
            entry[term] = 1 - (1 - value) * factor if term == "ssim" else value * factor
        log.append(entry)
    return log


def test_a_uniform_log_has_none():
    assert misfits(log_of()) == [] and misfits_html(log_of()) == "" and misfits([]) == []


def test_frames_are_named_with_their_term_worst_first():
    found = misfits(log_of(changes={(2, "depth"): 10, (5, "ssim"): 4, (6, "l1"): 2.9}))
    assert [(one.frame, one.term, round(one.ratio, 6)) for one in found] == [(2, "depth", 10.0), (5, "ssim", 4.0)]


def test_the_first_half_of_the_training_does_not_count():
    log = log_of()
    for entry in log[: len(log) // 2]:
        entry["depth"] *= 100 if entry["frame"] == 3 else 1
    assert misfits(log) == []


def test_few_visits_or_frames_say_nothing():
    assert misfits(log_of(visits=4, changes={(2, "depth"): 10})) == []  # two late visits
    assert misfits(log_of(frames=3, changes={(2, "depth"): 10})) == []


def test_a_disabled_term_and_an_event_of_the_log_are_ignored():
    log = [{"event": "resumed"}, *log_of(changes={(2, "l1"): 5})]
    for entry in log[1:]:
        del entry["depth"]
    assert [one.frame for one in misfits(log)] == [2]


def test_a_term_of_zero_has_no_ratio():
    assert misfits(log_of(changes={(frame, "depth"): 0.0 for frame in range(1, 8)})) == []


def test_the_table_names_the_file_to_check_and_how_many_there_are():
    found = misfits_html(log_of(frames=40, changes={(frame, "depth"): 10 for frame in range(MOST + 1)}))
    assert found.count("prior depth") == MOST and f"{MOST} largest of {MOST + 1}" in found
    assert "10.0" in found and "more than 3 times as large as that of the usual frame" in found
