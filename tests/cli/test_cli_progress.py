"""The time left that a training shows: of the iterations and targets to come, not of compilation."""

import io
from types import SimpleNamespace

import numpy as np
import pytest

from endotsr.cli.parts import progress
from endotsr.cli.parts.progress import Progress
from endotsr.cli.parts.waiting import in_words, waiting_line
from endotsr.clips.sequences.forecast.seconds import (
    COMPARED,
    COMPARED_TOGETHER,
    PAGES,
    Beside,
    TimedCommand,
    assumed_unit,
    estimated_seconds,
    evaluation_units,
    frames_of,
    vector_factor,
    visited,
)
from endotsr.clips.sequences.forecast.work import at_start, iteration_work, work_left
from endotsr.clips.sequences.splits import every_eighth
from endotsr.config import PRESETS, lengthened, with_settings
from endotsr.training.fitting.records import Making
from endotsr.training.runs.speed import TRAINED, KnownSpeed
from endotsr.training.runs.time_left import (
    BEFORE,
    BESIDE,
    LEAST_QUIET,
    MANY,
    PATIENCE,
    QUIET_AFTER,
    QUIET_BEFORE,
    SLOWED,
    Timed,
    TimeLeft,
    near_targets,
    unit_seconds,
)

PIXELS, GAP = 640 * 512, 0.15  # of a frame; seconds on one thread for the targets of a gap at full size
UNIT = 0.1


class Clock:
    """A clock that the test moves."""

    now = 0.0

    def monotonic(self):
        return self.now


def known(unit):
    """The speed of a machine on which a training took this time per unit."""
    return KnownSpeed(unit, Beside(), TRAINED)


def plan_of(preset, count, threads):
    frames = frames_of(*every_eighth(count))
    return TimedCommand(lengthened(PRESETS[preset], frames.training), frames, PIXELS, threads, perceived=None)


@pytest.mark.parametrize(("psnr", "said"), [(None, "loss 0.2500, 90 Gaussians, 0:05 left"),
                                            (30.0, "loss 0.2500, PSNR 30.00 dB, 90 Gaussians, 0:05 left")])  # fmt: skip
def test_a_psnr_that_no_view_has_yet_is_not_printed(psnr, said):
    """It is logged every tenth iteration; a resumed training began with nan dB."""
    shown = Progress(plan_of("demo", 24, 2))
    shown._means = {"loss": 0.25} | ({} if psnr is None else {"psnr": psnr})
    assert shown._state({"iteration": 56, "gaussians": 90}, "0:05") == said


class Told:
    """A training on a made-up machine, what it says, and the time left that it shows at every iteration.

    One thread makes the targets of a gap at its first visit. A second one makes one gap in each iteration beside it; in
    every third one, the training makes another gap and waits for it meanwhile.
    The kernels compile for three minutes in the first iteration, and for 40 s in the ninth. A coarse start lasts to
    `ends`, by default to the end of density control; from iteration 50 on, its end is expected, `ends` an eighth later.
    Another program makes the iterations of `slow` take 1.4 times as long.
    """

    def __init__(self, monkeypatch, plan, ends=None, slow=range(0)):
        clock, stderr, self.out, self.left = Clock(), io.StringIO(), [], {}
        monkeypatch.setattr(progress, "time", clock)
        monkeypatch.setattr(progress.sys, "stderr", stderr)
        shown, config, rng = Progress(plan), plan.config, np.random.default_rng(0)
        monkeypatch.setattr(shown, "say", self.out.append)
        state = SimpleNamespace(iteration=0, coarse=config.training.coarse_start, coarse_until=0, making=Making())
        shown.begin(state)
        total, made = config.training.iterations, set()
        for iteration in range(1, total + 1):
            if iteration == 50:
                state.coarse_until = ends * 9 // 8 if ends else config.density.until
            if state.coarse and iteration > (ends or config.density.until):
                state.coarse, state.making, made = False, Making(), set()
            size = 0.25 if state.coarse else 1.0
            count = self.gaussians(plan, iteration)
            clock.now += (
                UNIT
                * float(iteration_work(count, size * PIXELS, iteration / total))
                * (1.4 if iteration in slow else 1.0)
            )
            clock.now += {1: 180.0, 9: 40.0}.get(iteration, 0.0)
            gap = len(made) if plan.threads > 1 else int(rng.integers(plan.frames.gaps))
            bridged = plan.threads > 1 or rng.random() < config.training.bridge_fraction
            if bridged and gap not in made and gap < plan.frames.gaps:
                made.add(gap)
                gaps, waited, beside = state.making
                each = GAP * size
                if plan.threads == 1:
                    clock.now += each
                    state.making = Making(gaps + 1, waited + each, beside)
                elif iteration % 3 == 0:
                    clock.now += each
                    made.add(gap + 1)
                    state.making = Making(gaps + 2, waited + each, beside + each)
                else:
                    clock.now += SLOWED / plan.threads * each
                    state.making = Making(gaps + 1, waited, beside + each)
            shown.update({"iteration": iteration, "loss": 0.5, "psnr": None, "gaussians": count})
            left = shown.time_left.seconds(progress.Standing(iteration, count, state.coarse, state.coarse_until))
            if left is not None and iteration > 9:
                self.left[clock.now] = left
        self.lines, self.end = stderr.getvalue().splitlines(), clock.now

    @staticmethod
    def gaussians(plan, iteration):
        density = plan.config.density
        place = np.clip((iteration - density.start) / (density.until - density.start), 0, 1)
        if density.growth == "budget":
            return int(16_000 + 6_000 * place)
        return int(min(40_000 + 140_000 * place**0.6, density.maximum))  # steeper than the assumed growth


@pytest.fixture(scope="module", params=[("quick", 63, 1), ("quick", 156, 1), ("quick", 156, 2), ("sharp", 156, 2)])
def told(request):
    with pytest.MonkeyPatch.context() as patch:
        yield Told(patch, plan_of(*request.param))


def test_compilation_is_no_part_of_the_time_left(told):
    assert ", time left unknown" in told.lines[0] and told.lines[0].startswith("iteration 1 of ")
    assert told.lines[1].startswith("iteration 9 of ")
    now, left = next(iter(told.left.items()))  # after both compilations
    assert left == pytest.approx(told.end - now, rel=0.15)


def test_the_forecast_holds(told):
    assert len(told.out) == 1
    left = seconds(told.out[0].removeprefix("forecast: ").split(" of ")[0])
    at = min(told.left, key=lambda now: abs(told.left[now] - left))
    assert left == pytest.approx(told.end - at, rel=0.15)


def test_the_time_left_is_right_within_a_seventh_and_never_rises_by_a_tenth(told):
    least = np.inf
    for now, left in told.left.items():
        if now > told.end - 5:
            return
        assert left == pytest.approx(told.end - now, rel=0.15), now
        assert left <= 1.1 * least, now
        least = min(least, left)


def test_the_forecast_holds_if_the_coarse_start_ends_early(monkeypatch):
    told = Told(monkeypatch, plan_of("quick", 300, 1), ends=350)
    left = seconds(told.out[0].removeprefix("forecast: ").split(" of ")[0])
    at = min(told.left, key=lambda now: abs(told.left[now] - left))
    assert left == pytest.approx(told.end - at, rel=0.15)
    assert all(
        told.left[now] == pytest.approx(told.end - now, rel=0.15) for now in told.left if at < now < told.end - 5
    )


def test_the_time_left_does_not_rise_where_the_end_of_a_coarse_start_becomes_known(monkeypatch):
    """The first check expects it at a tenth of the iterations that were assumed before."""
    told = Told(monkeypatch, plan_of("quick", 300, 2)._replace(unit=UNIT), ends=250)
    least = np.inf
    for now, left in told.left.items():
        assert left <= 1.1 * least or now > told.end - 5, now
        least = min(least, left)


def test_half_a_minute_of_another_program_changes_the_time_left_of_a_long_run_by_less_than_a_tenth(monkeypatch):
    slow = range(2000, 2250)
    told = Told(monkeypatch, plan_of("sharp", 156, 2), slow=slow)
    least = np.inf
    for now, left in told.left.items():
        assert left <= 1.1 * least or now > told.end - 5, now
        least = min(least, left)
    assert len(slow) * UNIT < 30


def test_two_slow_gaps_do_not_speak_for_all_of_a_size():
    """At half size a gap took 0.05 s, so 0.2 s are expected at full size; the first two took 0.4 s each."""
    plan, left = plan_of("quick", 156, 2), []
    iterations, gaps = plan.config.training.iterations, plan.frames.gaps
    for slow in (0.2, 0.4):
        told, half = TimeLeft(plan), plan.config.density.until
        for iteration in range(half - 20, half):
            told.add(progress.Standing(iteration, 22_000, True), 0.05, Making(gaps, 0.0, 0.05 * gaps))
        at = progress.Standing(half + 1, 22_000, False)
        told.add(at, 0.1, Making(2, 0.0, 2 * slow))
        left.append(told._targets(0.1, at))
    visits = visited(plan.config, gaps, iterations - half - 1)
    assert left[0] == pytest.approx((gaps - 2) * visits * 0.2 / 2)
    assert left[1] == pytest.approx(left[0] * (10 * 0.2 + 2 * 0.4) / (12 * 0.2))


def seconds(shown):
    numbers = [int(part) for part in shown.removesuffix(" left").split(":")]
    return sum(n * 60**k for k, n in enumerate(reversed(numbers)))


def test_the_time_left_is_unknown_while_the_second_thread_works_but_not_for_long():
    """Its share of two cores differs between machines: with one constant, a forecast was a quarter too short."""
    plan = plan_of("quick", 156, 2)
    quick, patient = TimeLeft(plan), TimeLeft(plan)
    for k in range(1, 41):
        for one, seconds in ((quick, 0.1), (patient, PATIENCE / 40)):
            one.add(progress.Standing(k, 16_000), seconds, Making(k, 0.0, 0.05 * k))
        assert quick.unit is None and (patient.unit is None) == (k < 40), k
    for k in range(41, 42 + 5 * LEAST_QUIET):
        quick.add(progress.Standing(k, 16_000), 0.1, Making(40, 0.0, 2.0))
    assert quick.unit == pytest.approx(0.1 / float(iteration_work(16_000, PIXELS, 0.02, plan.vectors)), rel=0.1)


class Course:
    """Iterations of `quick` on a clip of 300 frames, each of which takes a number of seconds per unit of work."""

    def __init__(self, before=None):
        self.told, self.iteration, self.beside = TimeLeft(plan_of("quick", 300, 2)._replace(unit=before)), 0, 0.0

    def add(self, *units, coarse=False, beside=0.0):
        """beside   of the second thread per second of an iteration"""
        for unit in units:
            self.iteration += 1
            whole = self.told._plan.config.training.iterations
            work = float(iteration_work(16_000, PIXELS / 4 if coarse else PIXELS, self.iteration / whole))
            self.beside += beside * unit * work
            at = progress.Standing(self.iteration, 16_000, coarse, 250 * coarse)
            self.told.add(at, unit * work, Making(self.iteration if beside else 5, 0.0, self.beside))
        return self.told.unit


def mean(**weights):
    """The geometric mean of `u80=2, u100=1`: 0.080 with weight 2 and 0.100 with weight 1."""
    units = {float(name[1:]) / 1000: weight for name, weight in weights.items()}
    return np.exp(sum(weight * np.log(unit) for unit, weight in units.items()) / sum(units.values()))


def test_a_speed_that_was_timed_before_counts_while_the_second_thread_works():
    """Without it the time left of `quick` on a simulated clip of 300 frames was half as long again as it took."""
    for before, found in ((0.08, 0.08), (0.15, 0.1), (0.01, 0.05)):  # the median at most, half of the fastest at least
        course = Course(before)
        assert course.add(*[0.1] * 4, beside=0.2) is None, "too few iterations"
        course.add(0.1, beside=0.2)
        alone = 0.1 * (1 - SLOWED / 2 * 0.2)
        share = BESIDE * 5 / MANY
        expected = np.exp((BEFORE * np.log(found) + share * np.log(alone)) / (BEFORE + share))
        assert course.told.unit == pytest.approx(expected, rel=0.01)


def test_full_frames_without_the_second_thread_tell_the_speed_more_than_anything_else():
    """The coarse start of one run was slower by a quarter than that of another one on the same clip and machine."""
    course = Course(0.08)
    assert course.add(*[0.1] * MANY, coarse=True) == pytest.approx(mean(u80=2, u100=1))
    assert course.add(*[0.06] * LEAST_QUIET) == pytest.approx(mean(u80=2, u100=1, u60=1))
    assert course.add(*[0.06] * 9 * LEAST_QUIET) == pytest.approx(mean(u100=1, u60=12)), "the median contradicts 80"
    alone = Course()
    assert alone.add(*[0.1] * MANY, coarse=True) == pytest.approx(0.1)
    assert alone.add(*[0.06] * 10 * LEAST_QUIET) == pytest.approx(mean(u100=1, u60=10))


def test_a_slow_iteration_among_the_first_ones_without_the_second_thread_is_no_rise_of_a_tenth():
    """The check of a coarse start took as long as 3.5 iterations of it, and the time left rose by 14 %."""
    course = Course(0.08)
    before = course.add(*[0.08] * 180, beside=0.01, coarse=True)
    after = course.add(*[0.08] * 20, 0.28, coarse=True)
    assert after <= 1.06 * before


def iterations(*seconds, waited=0.0, beside=0.0):
    return [Timed(one, 1.0, waited, beside) for one in seconds]


def test_the_unit_follows_the_latest_iterations():
    assert unit_seconds(iterations(*[0.1] * 100), 0.8) == pytest.approx(0.1)
    assert unit_seconds(iterations(*[0.1] * 50 + [0.3] * 50), 0.8) == pytest.approx(0.2)
    assert unit_seconds(iterations(5.0, *[0.1] * 99), 0.8) == pytest.approx(0.1), "one that compiled is left out"
    assert unit_seconds(iterations(*[9.0] * 4), 0.8) is None


def test_what_the_second_thread_costs_the_iterations_is_no_part_of_their_unit():
    plain, slowed = iterations(*[0.1] * 50), iterations(*[0.18] * 50, beside=0.1)
    assert unit_seconds(plain + slowed, 0.8) == pytest.approx(0.1)
    waiting = iterations(*[0.1] * 50, waited=0.1, beside=0.1)
    assert unit_seconds(plain + waiting, 0.8) == pytest.approx(0.1), "nothing is slowed while the training waits"
    assert unit_seconds(iterations(*[0.1] * 50, beside=1.0), 0.8) == pytest.approx(0.05), "half at least"


def test_a_target_takes_as_long_as_several_iterations_of_which_the_last_one_knows_it():
    made = iterations(*[0.1] * 40) + iterations(0.1, beside=0.2) + iterations(*[0.1] * 40)
    assert near_targets(made) == set(range(40 - QUIET_BEFORE, 41 + QUIET_AFTER))
    assert near_targets(iterations(*[0.1] * 9)) == set()


def test_the_first_line_adds_up_and_names_what_comes_first():
    plan = plan_of("quick", 156, 2)._replace(perceived=True)
    found = estimated_seconds(plan, 0.05)
    line = waiting_line(plan, known(0.05), compiled=False)
    assert line.startswith(f"about {in_words(sum(found) - found.reading + 30)} for 156 frames (at the speed of the ")
    assert ": initial motion " in line and ", compilation, once 0:30, " in line and line.count(",") == 4
    assert "compilation" not in waiting_line(plan, known(0.05), compiled=True)
    assert "evaluation" not in waiting_line(plan._replace(perceived=None), known(0.05), compiled=True)


def test_the_first_line_of_a_resumed_training_tells_what_is_left():
    plan = plan_of("sharp", 156, 2)._replace(perceived=True)
    at = at_start(plan.config)._replace(iteration=plan.config.training.iterations - 100, gaussians=80_000)
    whole, rest = estimated_seconds(plan, 0.05), estimated_seconds(plan, 0.05, at)
    assert rest.start == 0 and rest.evaluation == whole.evaluation
    assert rest.iterations == pytest.approx(100 * 0.05, rel=0.2) and 0 < rest.targets < whole.targets
    assert ": 100 iterations " in waiting_line(plan, known(0.05), True, at)
    assert waiting_line(plan, known(1e-12), True, at).endswith(" (at the speed of the last training)"), (
        "no part takes a second"
    )
    assert "iterations" not in waiting_line(
        plan, known(0.05), True, at._replace(iteration=plan.config.training.iterations)
    )
    assert "initial motion" in waiting_line(plan, known(0.05), True, at._replace(iteration=0)), (
        "no checkpoint was written"
    )
    without = plan._replace(config=with_settings(plan.config, model={"spectral_motion": False}))
    assert estimated_seconds(without, 0.05).start == 0 < whole.start, "nothing is tracked without component S"


def test_the_training_of_the_base_model_is_part_of_the_forecast():
    """An `auto` weight is calibrated on it before the first iteration; a resumed training has its weight."""
    given = plan_of("paper", 63, 2)
    auto = given._replace(config=with_settings(given.config, loss={"lambda_lap": "auto"}))
    one, other = estimated_seconds(given, 0.1), estimated_seconds(auto, 0.1)
    assert 0.3 < other.calibration / one.iterations < 0.5, "3000 iterations before 6000"
    assert other._replace(calibration=0.0) == one and other.training > one.training
    line = waiting_line(auto, known(0.1), True)
    assert ", calibration " in line or ": calibration " in line
    at = at_start(given.config)._replace(iteration=10)
    assert estimated_seconds(given, 0.1, at) == estimated_seconds(auto, 0.1, at)
    base = with_settings(auto.config, model={"laplacian": False})
    assert estimated_seconds(auto._replace(config=base), 0.1) == one


@pytest.mark.parametrize(
    "given, shown",
    [(0.2, "1 second"), (54, "54 seconds"), (61, "1 minute"), (200, "3 minutes"), (5400, "1.5 hours")],
)
def test_minutes_in_words(given, shown):
    assert in_words(given) == shown


@pytest.mark.parametrize(("count", "pairs"), [(63, 10 * 62), (300, 12 * 63)])
def test_the_evaluation_of_a_simulated_clip_is_forecast_with_its_known_motion(count, pairs):
    """In processor time of one thread it took 0.16 s a pair, more than everything else of an evaluation."""
    for threads, each in ((1, COMPARED), (2, COMPARED * COMPARED_TOGETHER)):
        plan = plan_of("quick", count, threads)._replace(perceived=True)
        known = plan._replace(frames=plan.frames.with_true_motion())
        assert known.frames.compared == pairs
        more = estimated_seconds(known, 0.1).evaluation - estimated_seconds(plan, 0.1).evaluation
        assert more == pytest.approx(each * known.evaluating(0.1) * pairs)


def test_the_vectors_change_the_forecast_of_the_iterations_alone(monkeypatch):
    """Reading, motion and evaluation are assumed to take as long without AVX-512."""
    plan, seconds = plan_of("quick", 63, 2)._replace(perceived=True), {}
    for register, unit in ((64, 0.085), (32, 0.1275)):
        monkeypatch.setattr("endotsr.method.kernels.vectors.REGISTER", register)
        assert assumed_unit(2) == pytest.approx(unit)
        seconds[register] = estimated_seconds(plan._replace(vectors=vector_factor()), unit)
    work = {vectors: work_left(plan.config, PIXELS, at_start(plan.config), vectors) for vectors in (1.0, 1.5)}
    assert work[1.5] != work[1.0], "the parts of an iteration depend on the vectors"
    assert seconds[32].iterations / work[1.5] == pytest.approx(1.5 * seconds[64].iterations / work[1.0])
    assert seconds[32]._replace(iterations=0.0) == pytest.approx(seconds[64]._replace(iterations=0.0))


def test_the_evaluation_follows_the_speed_of_the_iterations_in_part_and_the_gaussians():
    """Libraries do most of it; the viewer and the report are written for every Gaussian."""
    few, many = (plan_of(preset, 63, 1)._replace(perceived=True) for preset in ("quick", "sharp"))
    slow, assumed = (estimated_seconds(few, unit).evaluation for unit in (4 * assumed_unit(1), assumed_unit(1)))
    assert few.vectors == 1.0 and slow == pytest.approx(2 * assumed)
    more = many.config.density.maximum - few.config.density.maximum
    found = estimated_seconds(many, 0.1).evaluation - estimated_seconds(few, 0.1).evaluation
    assert more > 0 and found == pytest.approx(few.evaluating(0.1) * PAGES * more)


def begun(monkeypatch, plan, seconds, iteration=0):
    """A training whose initial motion took this time, at the end of its iterations; and what it remembers."""
    clock, kept = Clock(), []
    monkeypatch.setattr(progress, "time", clock)
    monkeypatch.setattr("endotsr.training.runs.speed.remember_beside", lambda _, beside, pixels: kept.append(beside))
    shown = Progress(plan)
    clock.now += seconds
    shown.begin(SimpleNamespace(iteration=iteration))
    shown.remember_speed()
    return shown, clock, kept


def test_the_time_of_the_initial_motion_tells_the_speed_of_the_libraries(monkeypatch):
    """They took half of the time that follows from the iterations, on a processor whose two cores share their parts."""
    plan = plan_of("quick", 126, 2)._replace(perceived=True)
    said = estimated_seconds(plan, UNIT)
    shown, _, kept = begun(monkeypatch, plan, said.start / 2)
    found = estimated_seconds(shown._plan, UNIT)
    assert kept[-1].start == pytest.approx(plan.alone(UNIT) / 2)
    assert found.start == pytest.approx(said.start / 2) and found.targets == pytest.approx(said.targets / 2)
    assert found.evaluation == pytest.approx(plan.alone(UNIT) / 2**0.5 * evaluation_units(plan))
    assert found.iterations == said.iterations
    for seconds, iteration in ((2.9, 0), (9.0, 1)):  # too short; resumed
        assert begun(monkeypatch, plan, seconds, iteration)[2] == [Beside()]
    still = plan._replace(config=with_settings(plan.config, initialisation={"motion": "none"}))
    assert begun(monkeypatch, still, 9.0)[2] == [Beside()]


def test_the_next_command_forecasts_the_evaluation_with_the_time_of_this_one(monkeypatch):
    plan = plan_of("quick", 63, 2)._replace(perceived=True)
    shown, clock, kept = begun(monkeypatch, plan, 0.0)
    clock.now += 34.0
    shown.remember_evaluation()
    assert estimated_seconds(plan._replace(beside=kept[-1]), UNIT).evaluation == pytest.approx(34.0)
    more = plan._replace(beside=kept[-1], perceived=False)
    assert 0 < estimated_seconds(more, UNIT).evaluation < 34.0, "the unit, not the seconds"
    shown, clock, kept = begun(monkeypatch, plan._replace(perceived=None), 0.0)
    clock.now += 34.0
    shown.remember_evaluation()
    assert kept == [Beside()], "nothing was evaluated"
