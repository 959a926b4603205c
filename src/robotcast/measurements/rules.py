"""The rules of a measurement set as a whole: what its tables and rig.yaml say of each other.

What one cell may hold stands in `robotcast.casts.table`, what one key of rig.yaml in `rig_file`.
A rule reads all casts at once and yields what it finds: a set that contradicts itself is refused,
a cast that cannot be used is left out, one whose free end was not seen at rest has no endpoint
(its waypoints still serve tuning), and what could be true is a warning that names both numbers.
The order is that of the messages: a frame that does not fit is said before what follows from it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from robotcast.measurements.logs import REST_OVER_S, Logs

# What real ropes, hoses and wires are made of: foam 30, paracord 200, steel 7,850, copper 8,960;
# with a core of tungsten 19,300.
LIKELY_KG_M3, POSSIBLE_KG_M3 = (30.0, 9_000.0), (10.0, 20_000.0)
MOST_RADIUS = 0.2  # of the length: thicker is no cable
LIKELY_WEIGHT, MOST_WEIGHT = 20.0, 100.0  # of the cable's mass: grams come in a thousandfold
MOST_NOISE = 0.1  # of the length: with more, a cast tells nothing
# A straight cable is as long as it is: a slack start is bent by a few per cent, and a camera
# that is off by 15 cm or 20 %, as far as the library goes, shows 0.8 to 1.2 of it.
LIKELY_STRAIGHT, LEAST_STRAIGHT = 0.8, 0.5
# Beyond reach by this part of the length, besides noise: a tool and a camera 0.1 s apart at the
# 1.5 m/s of a cast show 0.1 to 0.15 in the median cast, and 0.25 at one waypoint.
LIKELY_BEYOND, MOST_BEYOND = 0.13, 0.25
OUT_OF_FRAME = 0.03  # the same, from which another frame is looked for, if it takes half away
NOISE_SD = 6.0  # standard deviations that noise does not reach
MOST_START_RAD = 0.5  # between yaw and the cable at the start
LIKELY_R0_M, MOST_R0_M = 0.05, 0.3  # between r0 and where the tool starts
FAR_ANGLE_RAD, NEAR_ANGLE_RAD = 0.3, 0.1  # arms end within 0.01 rad of where they are told to
MOST_ANGLE_RAD, MOST_RADIUS_M = 0.2, 0.08  # of one cast, where the others end as told
# The tool's top speed over vmax: a short arc reaches half of it, a radius that grows adds a fifth.
LIKELY_SPEED, POSSIBLE_SPEED = (0.4, 2.5), (0.15, 6.0)
LIKELY_PERIOD, POSSIBLE_PERIOD = 1.5, 3.0  # waypoints' spacing over period_s, or its inverse
# Between samples the tool is taken to go straight: at 10 m/s² that misses 3 mm in 0.05 s, 11 mm in
# 0.1 s. A gap matters where the tool moves on in it.
MOST_SPACING_S, GAP_S, GAPS, MOVED_M = 0.05, 0.06, 3.0, 0.01
RUNNING_M_S = 0.2  # a log that begins or ends so fast is cut; one of a whole motion is below 0.09
JUMP_M_S, JUMP_RAD_S = 5.0, 20.0  # no arm: a UR5 casts at 2.5 m/s and turns a joint at 3 rad/s
STALE = 0.4  # of a moving log's poses that repeat the one before
FEWEST_WAYPOINTS = 3  # while the tool moves
# Friction of 0.15 takes 1.5 m/s² from the end: it stops within a second of the tool's stop.
COAST_S, COASTING_M_S = 1.0, 0.5
EARLY_S, EARLY_M = 0.3, 0.05  # the end moves before the tool: more than any camera is late
MOST_NAMED = 20  # casts in one sentence
FROZEN = 4  # equal places in a row
REST_M_S = 0.25  # from there friction of 0.2 stops the end within 16 mm

FRAMES = {
    "y negated": np.diag([1.0, -1.0]),
    "x negated": np.diag([-1.0, 1.0]),
    "x and y negated": -np.eye(2),
    "x and y exchanged": np.array([[0.0, 1.0], [1.0, 0.0]]),
    "a quarter turn to the left": np.array([[0.0, -1.0], [1.0, 0.0]]),
    "a quarter turn to the right": np.array([[0.0, 1.0], [-1.0, 0.0]]),
}
UNITS = {1000: "millimetres", 100: "centimetres", 10: "decimetres", 39.37: "inches", 3.28: "feet"}


class Outcome(Enum):
    """What a rule that is broken does."""

    REFUSED = "the set is refused"
    UNUSABLE = "not used"
    UNRESTED = "not counted as endpoints"
    WARNING = "a warning"


@dataclass(frozen=True)
class Finding:
    """A rule that is broken, by the whole set or by some casts (rows of `Logs`)."""

    outcome: Outcome
    sentence: str
    casts: tuple[int, ...] = ()


Rule = Callable[[Logs], Iterator[Finding]]


def check(logs: Logs) -> list[Finding]:
    """Try every rule, in the order of `RULES`."""
    return [finding for rule in RULES for finding in rule(logs)]


def frame(logs: Logs) -> Iterator[Finding]:
    """The free end is no farther from the held point than the cable is long, in this frame."""
    beyond = _beyond(logs, np.eye(2))
    if np.median(beyond) > OUT_OF_FRAME:
        others = {name: np.median(_beyond(logs, turn)) for name, turn in FRAMES.items()}
        best = min(others, key=lambda name: others[name])
        if others[best] < np.median(beyond) / 2:
            yield Finding(
                Outcome.REFUSED,
                f"waypoints: the free end comes {1 + np.median(beyond):.2f} cable lengths from the "
                f"held point of the tool log, with {best} {1 + others[best]:.2f}; the two are in "
                "different frames: x goes along the board's axis, y to the left, not down",
            )
            return
    noise = NOISE_SD * logs.noise_m / logs.cable.length_m
    far = beyond > MOST_BEYOND + noise
    if np.mean(far) > 0.5:
        yield Finding(
            Outcome.REFUSED,
            f"waypoints: the free end comes {_most_away_m(logs).max():.3g} m from the held point, "
            f"and cable.length_m is {logs.cable.length_m:g}: another unit, another frame, or "
            "clocks that do not agree",
        )
    elif np.median(beyond) > LIKELY_BEYOND + noise:
        yield Finding(
            Outcome.WARNING,
            f"waypoints: the free end comes {np.median(_most_away_m(logs)):.3g} m from the held "
            f"point in half of the casts, and cable.length_m is {logs.cable.length_m:g}",
        )
    rows = logs.end.row_of_most(_away_m(logs))
    yield from _of_casts(
        Outcome.UNRESTED,
        logs,
        far & (np.mean(far) <= 0.5),
        lambda i: (
            f"waypoints at t = {logs.end.t_s[rows[i]]:.2f} s: the free end is "
            f"{_most_away_m(logs)[i]:.3g} m from the held point, and cable.length_m is "
            f"{logs.cable.length_m:g}: something else was followed"
        ),
    )


def length(logs: Logs) -> Iterator[Finding]:
    """A cast pulls the cable straight: then its ends are as far apart as it is long."""
    reached_m = float(np.median(_most_away_m(logs)))
    share = reached_m / logs.cable.length_m
    if share < LIKELY_STRAIGHT:
        near = [unit for times, unit in UNITS.items() if 0.9 < share * times < 1.1]
        yield Finding(
            Outcome.REFUSED if share < LEAST_STRAIGHT else Outcome.WARNING,
            f"rig.yaml: cable.length_m is {logs.cable.length_m:g}, and no more than "
            f"{reached_m:.3g} m lie between the cable's ends in half of the casts"
            + (f"; {near[0]} where metres are expected?" if near else ""),
        )


def cable(logs: Logs) -> Iterator[Finding]:
    """The cable is a long thin thing of a real material, its end no anvil."""
    it = logs.cable
    density = it.mass_kg / (np.pi * it.radius_m**2 * it.length_m)
    if not LIKELY_KG_M3[0] <= density <= LIKELY_KG_M3[1]:
        possible = POSSIBLE_KG_M3[0] <= density <= POSSIBLE_KG_M3[1]
        grams = LIKELY_KG_M3[0] <= density / 1000 <= LIKELY_KG_M3[1]
        yield Finding(
            Outcome.WARNING if possible else Outcome.REFUSED,
            f"rig.yaml: cable.mass_kg {it.mass_kg:g} in cable.radius_m {it.radius_m:g} and "
            f"cable.length_m {it.length_m:g} is a density of {density:.3g} kg/m³, and ropes and "
            "wires have 30 to 9,000" + ("; grams where kilograms are expected?" if grams else ""),
        )
    if it.radius_m > MOST_RADIUS * it.length_m:
        yield Finding(
            Outcome.REFUSED,
            f"rig.yaml: cable.radius_m {it.radius_m:g} is not far below cable.length_m "
            f"{it.length_m:g}; millimetres or centimetres where metres are expected?",
        )
    weight = it.endpoint_mass_kg / it.mass_kg
    if weight > LIKELY_WEIGHT:
        yield Finding(
            Outcome.REFUSED if weight > MOST_WEIGHT else Outcome.WARNING,
            f"rig.yaml: cable.endpoint_mass_kg {it.endpoint_mass_kg:g} is {weight:.0f} times "
            f"cable.mass_kg {it.mass_kg:g}; grams where kilograms are expected?",
        )
    if logs.noise_m > MOST_NOISE * it.length_m:
        yield Finding(
            Outcome.REFUSED,
            f"rig.yaml: camera.noise_m {logs.noise_m:g} is no noise beside cable.length_m "
            f"{it.length_m:g}; millimetres where metres are expected?",
        )


def period(logs: Logs) -> Iterator[Finding]:
    """Waypoints are a camera period apart, and the tool's log is dense enough to follow."""
    period_s, spacing_s = logs.measured.period_s, logs.end.spacing_s
    ratio = spacing_s / period_s
    if max(ratio, 1 / ratio) > LIKELY_PERIOD:
        yield Finding(
            Outcome.REFUSED if max(ratio, 1 / ratio) > POSSIBLE_PERIOD else Outcome.WARNING,
            f"waypoints: t goes in steps of {spacing_s:.3g} s, and camera.period_s in rig.yaml is "
            f"{period_s:g}; seconds, or frame numbers?",
        )
    if (tool_s := logs.tool.spacing_s) > MOST_SPACING_S and not logs.measured.tool_planned:
        yield Finding(
            Outcome.WARNING,
            f"tool: samples are {tool_s:.3g} s apart; between them the tool is taken to go "
            f"straight, which misses about {1e3 * 10 * tool_s**2 / 8:.0f} mm: log it faster",
        )


def yaw(logs: Logs) -> Iterator[Finding]:
    """At yaw 0 the cable leaves the gripper along +x; yaw grows to the left."""
    angle = np.abs(heading_off(logs))
    seen = np.isfinite(angle)
    if seen.any() and (off := float(np.median(angle[seen]))) > MOST_START_RAD:
        yield Finding(
            Outcome.WARNING,
            f"tool: at the start the cable lies {off:.2f} rad from yaw, in half of the casts",
        )
    first, last = logs.tool.values[logs.tool.first, 2], logs.tool.values[logs.tool.last, 2]
    asked = logs.actions[:, 2] + logs.actions[:, 4]
    told, negated = (np.median(np.abs(s * (last - first) - asked)) for s in (1, -1))
    if told > FAR_ANGLE_RAD and negated < NEAR_ANGLE_RAD:
        yield Finding(
            Outcome.REFUSED,
            f"tool: yaw ends {told:.2f} rad from theta2 + alpha of its action, negated "
            f"{negated:.2f} rad; yaw grows to the left, seen from above",
        )


def heading_off(logs: Logs) -> np.ndarray:
    """Return how far the cable lies from yaw at the start, (n,) [rad]; NaN where it is slack."""
    x, y = logs.start_m.T
    away = np.hypot(x, y) / logs.cable.length_m
    straight = (away > LIKELY_STRAIGHT) & (away < 1 + MOST_BEYOND)
    angle = np.arctan2(y, x) - logs.tool.values[logs.tool.first, 2]
    return np.where(straight, np.angle(np.exp(1j * angle)), np.nan)


def told(logs: Logs) -> Iterator[Finding]:
    """The tool starts at r0 and ends where its action says, about as fast."""
    start, end = (logs.tool.values[rows, :2] for rows in (logs.tool.first, logs.tool.last))
    starts_m = float(np.median(np.linalg.norm(start, axis=1)))
    off_m = abs(starts_m - logs.measured.r0_m)
    if off_m > LIKELY_R0_M:
        yield Finding(
            Outcome.REFUSED if off_m > MOST_R0_M else Outcome.WARNING,
            f"tool: casts start {starts_m:.3g} m from the base, and robot.r0_m in rig.yaml is "
            f"{logs.measured.r0_m:g}; the frame is the robot base's",
        )
    angle, radius = np.arctan2(end[:, 1], end[:, 0]), np.linalg.norm(end, axis=1)
    asked, asked_m, vmax = logs.actions[:, 2], logs.actions[:, 3], logs.actions[:, 5]
    off = np.abs(angle - asked)
    along = np.arctan2(logs.tool.values[:, 1], logs.tool.values[:, 0])
    turns = np.stack([0 * asked, logs.actions[:, 0], asked], axis=1)
    cut = (logs.tool.least(along) > turns.min(axis=1) - NEAR_ANGLE_RAD) & (
        logs.tool.most(along) < turns.max(axis=1) + NEAR_ANGLE_RAD
    )  # the motion stays between the angles that it is told, and ends elsewhere
    if np.median(off) > FAR_ANGLE_RAD and np.mean(cut) < 0.5:
        turned = {"y negated": -angle, "x and y exchanged": np.pi / 2 - angle}
        others = {name: float(np.median(np.abs(a - asked))) for name, a in turned.items()}
        best = min(others, key=lambda name: others[name])
        fits = others[best] < NEAR_ANGLE_RAD
        yield Finding(
            Outcome.REFUSED if fits else Outcome.WARNING,
            f"tool: casts end {np.median(off):.2f} rad from theta2 of their action"
            + (f", with {best} {others[best]:.2f} rad" if fits else "")
            + "; x goes along the board's axis, y to the left, and angles are counted from x",
        )
    else:
        yield from _of_casts(
            Outcome.UNUSABLE,
            logs,
            (off > MOST_ANGLE_RAD) | (np.abs(radius - asked_m) > MOST_RADIUS_M),
            lambda i: (
                f"the tool log ends at {angle[i]:.2f} rad and {radius[i]:.2f} m, and its action "
                f"at {asked[i]:.2f} rad and {asked_m[i]:.2f} m: the log is cut, or another cast's"
            ),
        )
    fast = float(np.median(logs.tool.most(logs.tool.speed_m_s) / vmax))
    if not LIKELY_SPEED[0] <= fast <= LIKELY_SPEED[1]:
        yield Finding(
            Outcome.WARNING if POSSIBLE_SPEED[0] <= fast <= POSSIBLE_SPEED[1] else Outcome.REFUSED,
            f"tool: the tool moves at up to {fast:.2g} times vmax of its action, in half of the "
            "casts; is t in seconds, and vmax the tool's speed in m/s?",
        )


def tool_log(logs: Logs) -> Iterator[Finding]:
    """The tool's log shows the whole motion: no hole, no jump, at rest when it begins and ends."""
    log = logs.tool
    gap = (log.dt_s > max(GAPS * log.spacing_s, GAP_S)) & (log.moved_m > MOVED_M)
    wide = log.row_of_most(np.where(gap, log.dt_s, 0.0))
    yield from _of_casts(
        Outcome.UNUSABLE,
        logs,
        log.most(gap),
        lambda i: (
            f"the tool log has no sample from t = {log.t_s[wide[i] - 1]:.3f} to "
            f"{log.t_s[wide[i]]:.3f} s, while the tool moves {log.moved_m[wide[i]]:.2f} m"
        ),
    )
    turned = np.abs(log.steps(log.values[:, 2]))
    jump = (log.speed_m_s > JUMP_M_S) & (log.moved_m > MOVED_M)
    jump |= (turned > JUMP_RAD_S * log.dt_s) & (turned > NEAR_ANGLE_RAD)
    worst = log.row_of_most(jump)
    yield from _of_casts(
        Outcome.UNUSABLE,
        logs,
        log.most(jump),
        lambda i: (
            f"the tool log jumps at t = {log.t_s[worst[i]]:.3f} s by {log.moved_m[worst[i]]:.2f} m "
            f"and {turned[worst[i]]:.2f} rad in {log.dt_s[worst[i]]:.3f} s, as no arm can"
        ),
    )
    yield from _of_casts(
        Outcome.UNUSABLE,
        logs,
        ~np.isfinite(logs.starts_s) | (log.most(logs.from_start_m) < MOVED_M),
        lambda i: "the tool does not move in its log",
    )
    begins, ends = log.speed_m_s[log.first + 1], log.speed_m_s[log.last]
    for speed, when in ((begins, "begins"), (ends, "ends")):
        yield from _of_casts(
            Outcome.UNUSABLE,
            logs,
            speed > RUNNING_M_S,
            lambda i, speed=speed, when=when: (
                f"the tool log {when} while the tool moves at {speed[i]:.2f} m/s"
            ),
        )
    moving = (log.t_s > logs.starts_s[log.cast]) & (log.t_s <= logs.stops_s[log.cast])
    same = (log.moved_m == 0) & (turned == 0)
    if moving.any() and (stale := float(np.mean(same[moving]))) > STALE:
        yield Finding(
            Outcome.WARNING,
            f"tool: {100 * stale:.0f} % of the samples repeat the pose before them while the tool "
            "moves: the log is written faster than the pose is updated",
        )


def clocks(logs: Logs) -> Iterator[Finding]:
    """Camera and tool saw the same motion on one clock."""
    end, cast = logs.end, logs.end.cast
    shared = (end.t_s >= logs.starts_s[cast]) & (
        end.t_s <= logs.stops_s[cast] + logs.measured.period_s
    )
    yield from _of_casts(
        Outcome.UNUSABLE,
        logs,
        np.add.reduceat(shared, end.first) < FEWEST_WAYPOINTS,
        lambda i: "fewer than three waypoints lie in the time of the tool's motion",
    )
    first_m = end.values[end.first[cast]]
    moved_m = np.linalg.norm(end.values - first_m, axis=1)
    early = (end.t_s < logs.starts_s[cast] - EARLY_S) & (
        moved_m > EARLY_M + NOISE_SD * logs.noise_m
    )
    yield from _of_casts(
        Outcome.UNUSABLE,
        logs,
        end.most(early),
        lambda i: f"the free end moves before the tool does, at t = {logs.starts_s[i]:.2f} s",
    )
    noise_m_s = NOISE_SD * logs.noise_m / REST_OVER_S
    late = (end.t_s > log_ends_s(logs)[cast] + COAST_S) & (
        logs.end_speed_m_s > COASTING_M_S + noise_m_s
    )
    yield from _of_casts(
        Outcome.UNUSABLE,
        logs,
        end.most(late),
        lambda i: (
            f"the free end still moves long after the tool log ended at t = "
            f"{log_ends_s(logs)[i]:.2f} s: the log is cut, or the clocks do not agree"
        ),
    )


def log_ends_s(logs: Logs) -> np.ndarray:
    """Return when each tool log ends, (n,)."""
    return logs.tool.t_s[logs.tool.last]


def tracking(logs: Logs) -> Iterator[Finding]:
    """Waypoints are seen anew in every frame, and are of one cast alone."""
    end = logs.end
    differ = np.abs(np.diff(end.values, axis=0))
    digit_m = float(differ[differ > 0].min(initial=np.inf))
    if logs.noise_m > 5 * digit_m:  # else places can be equal by rounding
        still = np.where(end.dt_s > 0, end.moved_m == 0, False)
        run = _run_lengths(still)
        rows = end.row_of_most(run)
        yield from _of_casts(
            Outcome.UNUSABLE,
            logs,
            end.most(run) >= FROZEN - 1,
            lambda i: (
                f"waypoints repeat one place to the last digit {run[rows[i]] + 1} times up to "
                f"t = {end.t_s[rows[i]]:.2f} s: the tracker was frozen"
            ),
        )
    seen: dict[bytes, int] = {}
    copies = np.full(len(logs.trials), -1)
    for i, trial in enumerate(logs.trials):
        if len(trial.waypoints_m) >= FEWEST_WAYPOINTS:
            copies[i] = seen.setdefault(trial.waypoints_m.tobytes(), i)
    copies[copies == np.arange(len(copies))] = -1
    yield from _of_casts(
        Outcome.UNUSABLE,
        logs,
        copies >= 0,
        lambda i: (
            f"its waypoints are those of trial {logs.trials[copies[i]].trial} to the last digit, "
            "and a copy is no repeat"
        ),
    )


def _run_lengths(flags: np.ndarray) -> np.ndarray:
    """Return how many of `flags` (N,) in a row hold up to each, (N,)."""
    counted = np.cumsum(flags)
    return counted - np.maximum.accumulate(np.where(flags, 0, counted))


def rest(logs: Logs) -> Iterator[Finding]:
    """An endpoint counts where the free end was seen at rest, and the tool with it."""
    end, last = logs.end, logs.end.last
    speed, fast = logs.end_speed_m_s[last], REST_M_S + NOISE_SD * logs.noise_m / REST_OVER_S
    yield from _of_casts(
        Outcome.UNRESTED,
        logs,
        speed > fast,
        lambda i: (
            f"the free end moves at {speed[i]:.2f} m/s when it is seen last, at t = "
            f"{end.t_s[last[i]]:.2f} s"
        ),
    )
    left_m = np.linalg.norm(logs.held_m[last] - logs.tool.values[logs.tool.last, :2], axis=1)
    yield from _of_casts(
        Outcome.UNRESTED,
        logs,
        (left_m > MOVED_M) & (speed <= fast),
        lambda i: (
            f"the free end is seen last at t = {end.t_s[last[i]]:.2f} s, and the tool moves "
            f"on {left_m[i]:.2f} m after that"
        ),
    )
    yield from _of_casts(
        Outcome.UNRESTED,
        logs,
        np.array([not trial.rested for trial in logs.trials]),
        lambda i: "actions: rested is 0",
    )


def _away_m(logs: Logs) -> np.ndarray:
    return np.linalg.norm(logs.end.values - logs.held_m, axis=1)


def _most_away_m(logs: Logs) -> np.ndarray:
    return logs.end.most(_away_m(logs))


def _beyond(logs: Logs, turn: np.ndarray) -> np.ndarray:
    """Return how far the end, x and y turned, is beyond reach at most, (n,), in lengths."""
    away_m = np.linalg.norm(logs.end.values @ turn.T - logs.held_m, axis=1)
    return logs.end.most(np.maximum(away_m / logs.cable.length_m - 1, 0.0))


def _of_casts(
    outcome: Outcome, logs: Logs, bad: np.ndarray, say: Callable[[int], str]
) -> Iterator[Finding]:
    """Yield one finding for the casts that are `bad` (n,); `say(cast)` tells what is wrong."""
    casts = np.flatnonzero(bad)
    if len(casts):
        numbers = [str(logs.trials[i].trial) for i in casts]
        rest = numbers[1:] if len(casts) <= MOST_NAMED else [*numbers[1:MOST_NAMED], "and more"]
        likewise = f"; so {len(casts) - 1} more, {', '.join(rest)}" if rest else ""
        sentence = f"trial {numbers[0]}: {say(int(casts[0]))}{likewise}; {outcome.value}"
        yield Finding(outcome, sentence, tuple(casts.tolist()))


RULES: tuple[Rule, ...] = (
    period,
    frame,
    length,
    cable,
    yaw,
    told,
    tool_log,
    clocks,
    tracking,
    rest,
)
