"""The rules of a measurement set as a whole, and what real cables, arms and cameras can do.

rules.yaml says of each rule what it reads, what it says and what follows.
"""

from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.spatial import KDTree

from robotcast.measurements.logs import REST_OVER_S, Log, Logs

# What real cables, arms and cameras can do: every threshold, with its reason.
# Foam has 30 kg/m³, paracord 200, steel 7,850, copper 8,960, tungsten 19,300.
LIKELY_KG_M3, POSSIBLE_KG_M3 = (30.0, 9_000.0), (10.0, 20_000.0)
MOST_RADIUS = 0.2  # of the length: thicker is no cable
LIKELY_WEIGHT, MOST_WEIGHT = 20.0, 100.0  # of the cable's mass: grams come in a thousandfold
MOST_NOISE = 0.1  # of the length: with more, a cast tells nothing
# The ends of a taut cable are as far apart as it is long. A camera that is off by 15 cm or 20 %,
# as far as the effects go, shows 0.8 to 1.2 of it.
LIKELY_TAUT, LEAST_TAUT = 0.8, 0.5
# Beyond reach by this part of the length, besides noise: a camera that is 0.1 s late shows 0.1 to
# 0.15 in the median cast of 1.5 m/s, and 0.22 at one waypoint.
LIKELY_BEYOND, MOST_BEYOND = 0.13, 0.25
OUT_OF_FRAME = 0.03  # the same, from which another frame is tried; it must take half away
NOISE_SD = 6.0  # standard deviations that noise does not reach
MOST_START_RAD = 0.5  # between yaw and the cable at the start
LIKELY_R0_M, MOST_R0_M = 0.05, 0.3  # between r0 and where the tool starts
FAR_RAD, NEAR_RAD = 0.3, 0.1  # arms end within 0.01 rad of where they are told to
MOST_OFF_RAD, MOST_OFF_M = 0.2, 0.08  # of the end of one cast
# The tool's top speed over vmax: a short arc reaches half of it, a radius that grows adds a fifth.
LIKELY_SPEED, POSSIBLE_SPEED = (0.4, 2.5), (0.15, 6.0)
LIKELY_PERIOD, MOST_PERIOD = 1.5, 3.0  # waypoints' spacing over period_s, or its inverse
# Between samples the tool is taken to go straight: at 10 m/s² that misses 3 mm in 0.05 s, 11 mm in
# 0.1 s.
MOST_SPACING_S, GAP_S, GAPS, MOVED_M = 0.05, 0.075, 3.0, 0.01
MOST_M_S2 = 10.0
RUNNING_M_S = 0.2  # a log that begins or ends so fast is cut; whole ones are below 0.09
# No arm: from sample to sample a UR5's speed changes by 0.2 m/s, and a joint turns at 3 rad/s.
JUMP_M_S, JUMP_RAD_S = 1.5, 20.0
STALE = 0.4  # of a moving log's poses that repeat the one before
FEWEST_WAYPOINTS = 3  # while the tool moves
# Friction of 0.15 takes 1.5 m/s each second: a second after the tool, the end is slow or at rest.
COAST_S, COASTING_M_S = 1.0, 0.5
EARLY_S, EARLY_M = 0.25, 0.02  # the end moves before the tool: no camera is so early
FROZEN, FROZEN_DIGITS = 4, 5.0  # equal places in a row, where noise is so many last digits
FILLED, FILLED_DIGITS = 2, 20.0  # the same of places that move on a line, as friction lets none
# Jumps to one place to the last digit, of what a program writes for a lost frame; noise if unknown.
FEWEST_LOST, LIKELY_NOISE_M = 3, 5e-4
# Decimals that a table was rounded to; no tracker repeats a whole path to a micrometre.
FEWEST_DIGITS, MOST_DIGITS, SAME_M = 2, 7, 1e-6
REST_M_S = 0.25  # from there friction of 0.2 stops the end within 16 mm

MOST_NAMED = 20  # casts in one sentence
FRAMES = {
    "y negated": np.diag([1.0, -1.0]),
    "x negated": np.diag([-1.0, 1.0]),
    "x and y negated": -np.eye(2),
    "x and y exchanged": np.array([[0.0, 1.0], [1.0, 0.0]]),
    "a quarter turn to the left": np.array([[0.0, -1.0], [1.0, 0.0]]),
    "a quarter turn to the right": np.array([[0.0, 1.0], [-1.0, 0.0]]),
}
SHIFTS = {"the tool log of the next trial": 1, "the tool log of the trial before": -1}
TURNED = {"y negated": 0.0, "x and y exchanged": np.pi / 2}  # angles become this less themselves
AXES = "x goes along the board's axis, y to the left, not down, and angles are counted from x"
UNITS = {1000: "millimetres", 100: "centimetres", 10: "decimetres", 39.37: "inches", 3.28: "feet"}


SAID_OF_CASTS = {"unusable": "not used", "unrested": "not counted as endpoints"}


class Finding(NamedTuple):
    """A rule that is broken, by the whole set or by some casts (their places in it)."""

    then: str  # "refused", "doubt" or "warning" of the set, or a key of `SAID_OF_CASTS`
    where: str
    sentence: str
    casts: tuple[int, ...] = ()


@cache
def _rules() -> dict[str, tuple[str, str, str]]:
    """Return what follows where a rule is broken, which table it names and what it says."""
    text = (files("robotcast.measurements") / "rules.yaml").read_text(encoding="utf-8")
    return {
        name: (then, of, says)
        for then, tables in yaml.safe_load(text).items()
        for of, rules in tables.items()
        for name, says in rules.items()
    }


class Findings(list[Finding]):
    """What the rules find in one set."""

    def __init__(self, logs: Logs) -> None:
        super().__init__()
        self._trials = logs.trials

    def of_set(self, name: str, likely: Any, possible: Any = True, **numbers: Any) -> None:
        """Note a rule that the set breaks: it is not `likely`, or not even `possible`."""
        if not (likely and possible):
            then, of, says = _rules()[name]
            then = then if possible else "refused"
            self.append(Finding(then, of, says.format(**numbers)))

    def of_casts(self, name: str, bad: np.ndarray, **numbers: Any) -> None:
        """Note a rule that the casts break which are `bad` (n,), with numbers (n,) of each."""
        casts = np.flatnonzero(bad).tolist()
        if casts:
            then, of, says = _rules()[name]
            told = {k: v[casts[0]] if isinstance(v, np.ndarray) else v for k, v in numbers.items()}
            names = [str(self._trials[i].trial) for i in casts[:MOST_NAMED]]
            names += ["and more"] if len(casts) > MOST_NAMED else []
            likewise = f"; so {len(casts) - 1} more, {', '.join(names[1:])}" * (len(casts) > 1)
            said = f"trial {names[0]}: {says.format(**told)}{likewise}; {SAID_OF_CASTS[then]}"
            self.append(Finding(then, of, said, tuple(casts)))


def check(logs: Logs) -> Findings:
    """Try every rule; what a log lacks is said before what follows from it.

    A planned motion is no measurement: an arm of another planner moves otherwise.
    """
    found = Findings(logs)
    of_tool = () if logs.measured.tool_planned else (told, yaw, tool_log, clocks, frame)
    for rule in (lost, tracking, period, *of_tool, length, cable, rest):
        rule(logs, found)
    return found


def period(logs: Logs, found: Findings) -> None:
    period_s, step_s, tool_s = logs.measured.period_s, logs.end.spacing_s, logs.tool.spacing_s
    ratio = max(step_s / period_s, period_s / step_s)  # NaN where no cast has two waypoints
    likely, possible = not ratio > LIKELY_PERIOD, not ratio > MOST_PERIOD
    found.of_set("period", likely, possible, step=step_s, period=period_s)
    dense = tool_s <= MOST_SPACING_S or logs.measured.tool_planned
    miss_mm = 1e3 * MOST_M_S2 * tool_s**2 / 8
    found.of_set("slow_log", dense, step=tool_s, miss_mm=miss_mm)


def told(logs: Logs, found: Findings) -> None:
    log, r0_m = logs.tool, logs.measured.r0_m
    starts_m = float(np.median(np.linalg.norm(log.values[log.first, :2], axis=1)))
    off_m = abs(starts_m - r0_m)
    likely, possible = off_m <= LIKELY_R0_M, off_m <= MOST_R0_M
    found.of_set("r0", likely, possible, start=starts_m, r0=r0_m)
    x, y, _ = log.values.T
    along, radius = np.arctan2(y, x), np.hypot(x, y)[log.last]
    angle, (theta1, _, theta2, r2, _, vmax) = along[log.last], logs.actions.T
    off, turns = np.abs(angle - theta2), np.stack([0 * theta1, theta1, theta2])
    asked = np.stack([turns.min(axis=0), turns.max(axis=0), theta2])
    made = np.stack([log.least(along), log.most(along), angle])
    # turned round, the largest angle becomes the smallest
    others = {name: (turn - made)[[1, 0, 2]] for name, turn in TURNED.items()}
    misses = {name: float(np.median(np.abs(o - asked).max(axis=0))) for name, o in others.items()}
    best = min(misses, key=lambda name: misses[name])
    fits, usual = misses[best] < NEAR_RAD, float(np.median(off))
    part = (made[0] > asked[0] - NEAR_RAD) & (made[1] < asked[1] + NEAR_RAD)
    if usual > FAR_RAD and (fits or np.mean(part) < 0.5):
        found.of_set("told", False, not fits, off=usual, other=best, miss=misses[best], axes=AXES)
    else:
        bad = (off > MOST_OFF_RAD) | (np.abs(radius - r2) > MOST_OFF_M)
        found.of_casts("cut", bad, angle=angle, radius=radius, theta2=theta2, r2=r2)
    speed = np.where(jumps(logs), 0.0, log.speed_m_s)
    times = float(np.median(log.most(speed) / vmax))
    (low, high), (least, most) = LIKELY_SPEED, POSSIBLE_SPEED
    found.of_set("vmax", low <= times <= high, least <= times <= most, times=times)


def yaw(logs: Logs, found: Findings) -> None:
    off = np.abs(heading_off(logs))
    lies = float(np.median(off[np.isfinite(off)])) if np.isfinite(off).any() else 0.0
    found.of_set("heading", lies < MOST_START_RAD, off=lies)
    turned = logs.tool.values[logs.tool.last, 2] - logs.tool.values[logs.tool.first, 2]
    asked = logs.actions[:, 2] + logs.actions[:, 4]
    off, negated = (float(np.median(np.abs(s * turned - asked))) for s in (1, -1))
    likely, possible = off <= FAR_RAD, off <= NEAR_RAD or negated > off / 3
    found.of_set("yaw", likely, possible, off=off, negated=negated)


def heading_off(logs: Logs) -> np.ndarray:
    """Return how far the cable lies from yaw at the start, (n,) [rad]; NaN where it is slack."""
    x, y = logs.start_m.T
    apart = np.hypot(x, y) / logs.cable.length_m
    taut = (apart > LIKELY_TAUT) & (apart < 1 + MOST_BEYOND)
    angle = np.arctan2(y, x) - logs.tool.values[logs.tool.first, 2]
    return np.where(taut, np.angle(np.exp(1j * angle)), np.nan)


def jumps(logs: Logs) -> np.ndarray:
    """Tell in which rows of the tool log the pose is not where an arm could bring it, (N,)."""
    log, turned = logs.tool, logs.tool.turned_rad
    jump = (log.steps(log.speed_m_s) > JUMP_M_S) & (log.moved_m > MOVED_M)
    return jump | ((turned > JUMP_RAD_S * log.dt_s) & (turned > NEAR_RAD))


def tool_log(logs: Logs, found: Findings) -> None:
    log = logs.tool
    t_s, dt_s, moved_m, turned = log.t_s, log.dt_s, log.moved_m, log.turned_rad
    moving = (t_s > logs.starts_s[log.cast]) & (t_s <= logs.stops_s[log.cast])
    same = (moved_m == 0) & (turned == 0)
    stale = float(np.mean(same[moving])) if moving.any() else 0.0
    updated_s, likely = log.spacing_s / max(1 - stale, 1e-9), stale < STALE
    possible = likely or updated_s <= MOST_SPACING_S
    found.of_set("stale", likely, possible, percent=100 * stale, step=updated_s)
    gap = dt_s > max(GAPS * log.spacing_s, GAP_S)
    gap &= moved_m > MOVED_M
    row = log.row_of_most(np.where(gap, dt_s, 0.0))
    found.of_casts("gap", log.most(gap), since=t_s[row - 1], until=t_s[row], moved=moved_m[row])
    jump = jumps(logs) & likely
    row = log.row_of_most(np.where(jump, moved_m + turned, 0.0))
    numbers = dict(at=t_s[row], moved=moved_m[row], turned=turned[row], step=dt_s[row])
    found.of_casts("jump", log.most(jump), **numbers)
    found.of_casts("still", log.most(logs.from_start_m) < MOVED_M)
    begins, ends = (
        log.speed_m_s[rows] - MOST_M_S2 * dt_s[rows] for rows in (log.first + 1, log.last)
    )
    does = np.where(begins > ends, "begins", "ends")
    speed = np.maximum(begins, ends)
    found.of_casts("running", speed > RUNNING_M_S, does=does, speed=speed)


def clocks(logs: Logs, found: Findings) -> None:
    end, cast, noise_m = logs.end, logs.end.cast, NOISE_SD * logs.noise_m
    until_s = logs.stops_s + logs.measured.period_s
    shared = (end.t_s >= logs.starts_s[cast]) & (end.t_s <= until_s[cast])
    apart = np.add.reduceat(shared.astype(int), end.first) < FEWEST_WAYPOINTS
    found.of_casts("apart", apart, fewest=FEWEST_WAYPOINTS)
    away_m = np.linalg.norm(end.values - end.values[end.first[cast]], axis=1)
    moves_m = end.most(away_m)[~apart]
    found.of_set("unmoved", not len(moves_m) or np.median(moves_m) > EARLY_M)
    early = end.t_s < logs.starts_s[cast] - EARLY_S
    moves = away_m > EARLY_M + noise_m
    before = end.most(early & moves)
    found.of_casts("early", before, start=logs.starts_s)
    known = ~apart & np.isfinite(logs.starts_s)
    ahead_s = logs.starts_s[known] - end.least(np.where(moves, end.t_s, np.inf))[known]
    lead_s = float(np.median(ahead_s)) if known.any() else 0.0
    found.of_set("ahead", lead_s <= 0 or before.any(), lead=lead_s)
    ends_s = logs.tool.t_s[logs.tool.last]
    late = logs.end_speed_m_s > COASTING_M_S + noise_m / REST_OVER_S
    late &= end.t_s > ends_s[cast] + COAST_S
    found.of_casts("late", end.most(late), coast=COAST_S, end=ends_s)


def frame(logs: Logs, found: Findings) -> None:
    most_m, length_m = logs.end.most(logs.away_m()), logs.cable.length_m
    beyond = np.maximum(most_m / length_m - 1, 0.0)
    usual, others = float(np.median(beyond)), {}
    if usual > OUT_OF_FRAME:
        tried = {name: logs.away_m(turn=turn) for name, turn in FRAMES.items()}
        tried |= {name: logs.away_m(shift=shift) for name, shift in SHIFTS.items()}
        for name, away_m in tried.items():
            others[name] = max(float(np.median(logs.end.most(away_m))) / length_m - 1, 0.0)
    best = min(others, key=lambda name: others[name], default="")
    if best and others[best] < min(usual / 2, LIKELY_BEYOND):
        why = "trials are numbered otherwise" if best in SHIFTS else f"the frames differ; {AXES}"
        numbers = dict(lengths=1 + usual, other=best, better=1 + others[best], why=why)
        return found.of_set("frame", False, **numbers)
    noise = NOISE_SD * logs.noise_m / length_m
    far, away = beyond > MOST_BEYOND + noise, float(np.median(most_m))
    likely, possible = usual < LIKELY_BEYOND + noise, np.mean(far) <= 0.5
    found.of_set("reach", likely, possible, away=away, length=length_m)
    at_s = logs.end.t_s[logs.end.row_of_most(logs.away_m())]
    found.of_casts("astray", far, at=at_s, away=most_m, length=length_m)


def length(logs: Logs, found: Findings) -> None:
    apart_m = logs.end.most(logs.away_m())
    if logs.measured.tool_planned:
        apart_m = np.linalg.norm(logs.start_m, axis=1)  # all that is known
    known = np.isfinite(apart_m)
    reached_m = float(np.median(apart_m[known])) if known.any() else logs.cable.length_m
    share = reached_m / logs.cable.length_m
    unit = [name for times, name in UNITS.items() if 0.9 < share * times < 1.1]
    hint = f"{unit[0]} where metres are expected" if unit else "or x and y of another origin"
    likely, possible = share > LIKELY_TAUT, share > LEAST_TAUT
    numbers = dict(length=logs.cable.length_m, reached=reached_m, hint=hint)
    found.of_set("length", likely, possible, **numbers)


def cable(logs: Logs, found: Findings) -> None:
    it = logs.cable
    sizes = dict(mass=it.mass_kg, radius=it.radius_m, length=it.length_m)
    density = it.mass_kg / (np.pi * it.radius_m**2 * it.length_m)
    (low, high), (least, most) = LIKELY_KG_M3, POSSIBLE_KG_M3
    hint = "; grams where kilograms are expected?" if low <= density / 1000 <= high else ""
    likely, possible = low <= density <= high, least <= density <= most
    found.of_set("density", likely, possible, density=density, hint=hint, **sizes)
    found.of_set("thick", it.radius_m <= MOST_RADIUS * it.length_m, **sizes)
    times = it.endpoint_mass_kg / it.mass_kg
    likely, possible = times <= LIKELY_WEIGHT, times <= MOST_WEIGHT
    found.of_set("weight", likely, possible, weight=it.endpoint_mass_kg, times=times, **sizes)
    quiet = logs.noise_m <= MOST_NOISE * it.length_m
    found.of_set("noise", quiet, noise=logs.noise_m, **sizes)


def lost(logs: Logs, found: Findings) -> None:
    """Find the place, 0, 0 or -1, -1, that stands for frames in which the end was lost."""
    end, far_m = logs.end, MOST_NOISE * logs.cable.length_m
    came = np.flatnonzero(end.moved_m > far_m)
    if not len(came) or logs.digit_m > (logs.noise_m or LIKELY_NOISE_M):
        return
    jumps = np.unique(np.hstack([end.values[came - 1], end.values[came]]), axis=0)  # once of copies
    places, times = np.unique(jumps[:, 2:], axis=0, return_counts=True)
    most = int(np.argmax(times))
    off_m = np.linalg.norm(end.values - places[most], axis=1)
    alone = not ((off_m > 0) & (off_m < far_m)).any()  # as no place of a path is
    row = int(np.argmin(off_m))
    numbers = dict(trial=logs.trials[end.cast[row]].trial, at=end.t_s[row], times=times[most])
    likely = times[most] < FEWEST_LOST or not alone
    found.of_set("lost", likely, x=places[most, 0], y=places[most, 1], **numbers)


def tracking(logs: Logs, found: Findings) -> None:
    end, digit_m = logs.end, logs.digit_m
    same = (end.dt_s > 0) & (end.moved_m == 0) & (logs.noise_m > FROZEN_DIGITS * digit_m)
    near_m = max(digit_m, SAME_M)
    line = (off_line_m(end) <= near_m) & (end.moved_m > logs.noise_m)
    line &= logs.noise_m > FILLED_DIGITS * near_m
    for name, bad, fewest in (("frozen", same, FROZEN - 1), ("filled", line, FILLED)):
        counted = np.cumsum(bad)
        run = counted - np.maximum.accumulate(np.where(bad, 0, counted))
        rows = end.row_of_most(run)
        found.of_casts(name, end.most(run) >= fewest, times=1 + run[rows], at=end.t_s[rows])
    first = copied_from(logs)
    other = np.array([trial.trial for trial in logs.trials])[first]
    found.of_casts("copy", first < np.arange(len(first)), other=other)


def off_line_m(end: Log) -> np.ndarray:
    """Return how far each row is from the line in time between its neighbours, (N,) [m].

    The larger coordinate's; infinite where a cast begins or ends.
    """
    off_m = np.full(len(end.t_s), np.inf)
    step, dt_s = end.steps(end.values), end.dt_s[:, None]
    inner = np.setdiff1d(np.arange(len(off_m)), np.union1d(end.first, end.last))
    whole_s = dt_s[inner] + dt_s[inner + 1]
    bent = (step[inner] * dt_s[inner + 1] - step[inner + 1] * dt_s[inner]) / whole_s
    off_m[inner] = np.abs(bent).max(axis=1, initial=0.0)
    return off_m


def copied_from(logs: Logs) -> np.ndarray:
    """Return the first cast whose waypoints each cast has too, (n,), itself where none does.

    To the last digit, or to the last one that was kept where one of the two was rounded.
    """
    end, casts = logs.end, np.arange(len(logs.trials))
    first, counts, digit_m = casts.copy(), end.last - end.first, np.zeros(len(casts))
    for digits in range(MOST_DIGITS, FEWEST_DIGITS - 1, -1):
        units = end.values * 10**digits
        whole = end.most(np.abs(units - np.round(units)).max(axis=1)) < 1e-3
        digit_m[whole] = 10.0**-digits
    for count in np.unique(counts):
        alike = casts[counts == count]
        paths = np.stack([logs.trials[i].waypoints_m.ravel() for i in alike])
        widest_m = max(SAME_M, float(digit_m[alike].max()))
        pairs = KDTree(paths).query_pairs(widest_m, p=np.inf, output_type="ndarray")
        apart_m = np.abs(np.diff(paths[pairs], axis=1)).max(axis=-1, initial=0.0)[:, 0]
        one, other = alike[pairs].T
        rounded = digit_m[one] != digit_m[other]
        most_m = np.where(rounded, (digit_m[one] + digit_m[other]) / 2, 0.0) + SAME_M
        np.minimum.at(first, other[apart_m <= most_m], one[apart_m <= most_m])
    return first


def rest(logs: Logs, found: Findings) -> None:
    end, last = logs.end, logs.end.last
    speed, until_s = logs.end_speed_m_s, end.t_s[last]
    fast = REST_M_S + NOISE_SD * logs.noise_m / REST_OVER_S
    moving = speed[last] > fast
    found.of_casts("moving", moving, speed=speed[last], until=until_s)
    tool_end = logs.tool.values[logs.tool.last, :2]
    left_m = np.linalg.norm(logs.held_m[last] - tool_end, axis=1)
    left = (left_m > MOVED_M) & ~moving & (not logs.measured.tool_planned)
    found.of_casts("left_early", left, until=until_s, left=left_m)
    # at rest with the tool, and then fast again: something else was followed
    again = (speed > 2 * fast) & (end.t_s > logs.stops_s[end.cast] + COAST_S / 2)
    again &= (end.steps(speed) > fast) & (not logs.measured.tool_planned)
    rows, known = end.row_of_most(again), moving | left
    moved = end.most(again) & ~known
    found.of_casts("moved_again", moved, speed=speed[rows], at=end.t_s[rows])
    told = np.array([not trial.rested for trial in logs.trials])
    found.of_casts("not_rested", told & ~(known | moved))
