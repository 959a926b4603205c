"""The rules of a measurement set as a whole: what its tables and rig.yaml say of each other.

What one cell may hold stands in `robotcast.casts.table`, one row in `rows`, one key of rig.yaml in
`rig_file`, the thresholds in `limits`. A rule here reads all casts at once: a set that contradicts
itself is refused, a cast that cannot be used is left out, one whose free end was not seen at rest
has no endpoint (its waypoints still serve tuning), and what could be true is a warning that names
both numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from robotcast.measurements import limits
from robotcast.measurements.logs import REST_OVER_S, Logs

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
GRAMS = "grams where kilograms are expected?"


class Outcome(Enum):
    """What a broken rule does."""

    REFUSED = "the set is refused"
    UNUSABLE = "not used"
    UNRESTED = "not counted as endpoints"
    WARNING = "a warning"


@dataclass(frozen=True)
class Finding:
    """A rule that is broken, by the whole set or by some casts (their places in it).

    `where` is the table that shows it, or "rig.yaml".
    """

    outcome: Outcome
    where: str
    sentence: str
    casts: tuple[int, ...] = ()


class Findings(list[Finding]):
    """What the rules find in one set."""

    def refuse(self, bad: object, where: str, sentence: str) -> None:
        if bad:
            self.append(Finding(Outcome.REFUSED, where, sentence))

    def doubt(self, likely: object, possible: object, where: str, sentence: str) -> None:
        """Warn of what is not likely, refuse what is not possible."""
        if not (likely and possible):
            outcome = Outcome.WARNING if possible else Outcome.REFUSED
            self.append(Finding(outcome, where, sentence))

    def casts(
        self, outcome: Outcome, where: str, logs: Logs, bad: np.ndarray, say: Callable[[int], str]
    ) -> None:
        """Find the casts that are `bad` (n,); `say(cast)` tells what is wrong."""
        casts = np.flatnonzero(bad)
        if len(casts):
            numbers = [str(logs.trials[i].trial) for i in casts[:MOST_NAMED]]
            numbers += ["and more"] if len(casts) > MOST_NAMED else []
            likewise = f"; so {len(casts) - 1} more, {', '.join(numbers[1:])}" * (len(casts) > 1)
            sentence = f"trial {numbers[0]}: {say(int(casts[0]))}{likewise}; {outcome.value}"
            self.append(Finding(outcome, where, sentence, tuple(casts.tolist())))


def check(logs: Logs) -> Findings:
    """Try every rule; what a log lacks is said before what follows from it."""
    found = Findings()
    for rule in RULES:
        rule(logs, found)
    return found


def period(logs: Logs, found: Findings) -> None:
    """Waypoints are a camera period apart; the tool's log is dense enough to follow."""
    period_s, spacing_s, tool_s = logs.measured.period_s, logs.end.spacing_s, logs.tool.spacing_s
    ratio = max(spacing_s / period_s, period_s / spacing_s)
    found.doubt(
        not ratio > limits.LIKELY_PERIOD,  # NaN where no cast has two waypoints
        not ratio > limits.MOST_PERIOD,
        "waypoints",
        f"t goes in steps of {spacing_s:.3g} s, and camera.period_s in rig.yaml is {period_s:g}: "
        "one of them is not in seconds, or frame numbers",
    )
    found.doubt(
        tool_s <= limits.MOST_SPACING_S or logs.measured.tool_planned,
        True,
        "tool",
        f"samples are {tool_s:.3g} s apart; between them the tool is taken to go straight, which "
        f"misses about {1e3 * limits.MOST_M_S2 * tool_s**2 / 8:.0f} mm: log it faster",
    )


def frame(logs: Logs, found: Findings) -> None:
    """The free end is no farther from the held point than the cable is long."""
    most_m, length_m = logs.end.most(logs.away_m()), logs.cable.length_m
    beyond = np.maximum(most_m / length_m - 1, 0.0)
    usual = float(np.median(beyond))
    others = {}
    if usual > limits.OUT_OF_FRAME:
        tried = {name: logs.away_m(turn=turn) for name, turn in FRAMES.items()}
        tried |= {name: logs.away_m(shift=shift) for name, shift in SHIFTS.items()}
        for name, away_m in tried.items():
            others[name] = max(float(np.median(logs.end.most(away_m))) / length_m - 1, 0.0)
    best = min(others, key=lambda name: others[name], default="")
    if best and others[best] < min(usual / 2, limits.LIKELY_BEYOND):
        why = "trials are numbered otherwise" if best in SHIFTS else f"the frames differ; {AXES}"
        return found.refuse(
            True,
            "waypoints",
            f"in half of the casts the free end comes {1 + usual:.2f} cable lengths or more from "
            f"the held point of the tool log, with {best} {1 + others[best]:.2f}: {why}",
        )
    noise = limits.NOISE_SD * logs.noise_m / length_m
    far = beyond > limits.MOST_BEYOND + noise
    found.doubt(
        usual < limits.LIKELY_BEYOND + noise,
        np.mean(far) <= 0.5,
        "waypoints",
        f"in half of the casts the free end comes {np.median(most_m):.3g} m or more from the held "
        f"point, and cable.length_m in rig.yaml is {length_m:g}: another unit or frame, or clocks "
        "that do not agree",
    )
    rows = logs.end.row_of_most(logs.away_m())
    found.casts(
        Outcome.UNRESTED,
        "waypoints",
        logs,
        far,
        lambda i: (
            f"at t = {logs.end.t_s[rows[i]]:.2f} s the free end is {most_m[i]:.3g} m from the held "
            f"point, and cable.length_m is {length_m:g}: something else was followed"
        ),
    )


def length(logs: Logs, found: Findings) -> None:
    """A cast pulls the cable taut: then its ends are as far apart as it is long."""
    reached_m = float(np.median(logs.end.most(logs.away_m())))
    share = reached_m / logs.cable.length_m
    unit = [name for times, name in UNITS.items() if 0.9 < share * times < 1.1]
    found.doubt(
        share > limits.LIKELY_TAUT,
        share > limits.LEAST_TAUT,
        "rig.yaml",
        f"cable.length_m is {logs.cable.length_m:g}, and in half of the casts no more than "
        f"{reached_m:.3g} m lie between the cable's ends"
        + (f"; {unit[0]} where metres are expected?" if unit else ""),
    )


def cable(logs: Logs, found: Findings) -> None:
    """The cable is long, thin and of a real material, and its end no anvil."""
    it = logs.cable
    density = it.mass_kg / (np.pi * it.radius_m**2 * it.length_m)
    grams = limits.LIKELY_KG_M3[0] <= density / 1000 <= limits.LIKELY_KG_M3[1]
    found.doubt(
        limits.LIKELY_KG_M3[0] <= density <= limits.LIKELY_KG_M3[1],
        limits.POSSIBLE_KG_M3[0] <= density <= limits.POSSIBLE_KG_M3[1],
        "rig.yaml",
        f"cable.mass_kg {it.mass_kg:g} with cable.radius_m {it.radius_m:g} and cable.length_m "
        f"{it.length_m:g} makes {density:.3g} kg/m³, and ropes and wires have 30 to 9,000"
        + (f"; {GRAMS}" if grams else ""),
    )
    found.refuse(
        it.radius_m > limits.MOST_RADIUS * it.length_m,
        "rig.yaml",
        f"cable.radius_m {it.radius_m:g} is not far below cable.length_m {it.length_m:g}; "
        "millimetres or centimetres where metres are expected?",
    )
    weight = it.endpoint_mass_kg / it.mass_kg
    found.doubt(
        weight <= limits.LIKELY_WEIGHT,
        weight <= limits.MOST_WEIGHT,
        "rig.yaml",
        f"cable.endpoint_mass_kg {it.endpoint_mass_kg:g} is {weight:.0f} times cable.mass_kg "
        f"{it.mass_kg:g}; {GRAMS}",
    )
    found.refuse(
        logs.noise_m > limits.MOST_NOISE * it.length_m,
        "rig.yaml",
        f"camera.noise_m {logs.noise_m:g} is no noise beside cable.length_m {it.length_m:g}; "
        "millimetres where metres are expected?",
    )


def told(logs: Logs, found: Findings) -> None:
    """The tool starts at r0 and ends where its action says, about as fast."""
    log, r0_m = logs.tool, logs.measured.r0_m
    starts_m = float(np.median(np.linalg.norm(log.values[log.first, :2], axis=1)))
    found.doubt(
        abs(starts_m - r0_m) <= limits.LIKELY_R0_M,
        abs(starts_m - r0_m) <= limits.MOST_R0_M,
        "tool",
        f"casts start {starts_m:.3g} m from the base, and robot.r0_m in rig.yaml is {r0_m:g}; "
        "the frame is the robot base's",
    )
    x, y, _ = log.values.T
    along, radius = np.arctan2(y, x), np.hypot(x, y)[log.last]
    angle, (theta1, _, theta2, r2, _, vmax) = along[log.last], logs.actions.T
    off = np.abs(angle - theta2)
    turns = np.stack([0 * theta1, theta1, theta2])
    asked = np.stack([turns.min(axis=0), turns.max(axis=0), theta2])
    made = np.stack([log.least(along), log.most(along), angle])
    # y negated, and x and y exchanged: the largest angle becomes the smallest
    others = {name: (turn - made)[[1, 0, 2]] for name, turn in TURNED.items()}
    misses = {name: float(np.median(np.abs(o - asked).max(axis=0))) for name, o in others.items()}
    best = min(misses, key=lambda name: misses[name])
    cut = (made[0] > asked[0] - limits.NEAR_RAD) & (made[1] < asked[1] + limits.NEAR_RAD)
    if np.median(off) > limits.FAR_RAD and (misses[best] < limits.NEAR_RAD or np.mean(cut) < 0.5):
        fits = misses[best] < limits.NEAR_RAD
        with_best = f", with {best} {misses[best]:.2f} rad" if fits else ""
        found.doubt(
            False,
            not fits,
            "tool",
            f"casts end {np.median(off):.2f} rad from theta2 of their action{with_best}; {AXES}",
        )
    else:
        found.casts(
            Outcome.UNUSABLE,
            "tool",
            logs,
            (off > limits.MOST_OFF_RAD) | (np.abs(radius - r2) > limits.MOST_OFF_M),
            lambda i: (
                f"the log ends at {angle[i]:.2f} rad and {radius[i]:.2f} m, and its action at "
                f"{theta2[i]:.2f} rad and {r2[i]:.2f} m: it is cut, or another cast's"
            ),
        )
    usual = np.where(jumps(logs), 0.0, log.speed_m_s)
    fast = float(np.median(log.most(usual) / vmax))
    found.doubt(
        limits.LIKELY_SPEED[0] <= fast <= limits.LIKELY_SPEED[1],
        limits.POSSIBLE_SPEED[0] <= fast <= limits.POSSIBLE_SPEED[1],
        "tool",
        f"in half of the casts the tool reaches {fast:.2g} times vmax of its action or more; is t "
        "in seconds, and vmax the tool's speed in m/s?",
    )


def yaw(logs: Logs, found: Findings) -> None:
    """Yaw points along the cable where it leaves the gripper, and grows to the left."""
    off = np.abs(heading_off(logs))
    lies = float(np.median(off[np.isfinite(off)])) if np.isfinite(off).any() else 0.0
    found.doubt(
        lies < limits.MOST_START_RAD,
        True,
        "tool",
        f"in half of the casts the cable lies {lies:.2f} rad or more from yaw at the start",
    )
    turned = logs.tool.values[logs.tool.last, 2] - logs.tool.values[logs.tool.first, 2]
    asked = logs.actions[:, 2] + logs.actions[:, 4]
    as_told, negated = (float(np.median(np.abs(s * turned - asked))) for s in (1, -1))
    found.doubt(
        as_told <= limits.FAR_RAD,
        negated > limits.NEAR_RAD,
        "tool",
        f"yaw ends {as_told:.2f} rad from theta2 + alpha of its action, negated {negated:.2f} "
        "rad; yaw grows to the left, seen from above",
    )


def heading_off(logs: Logs) -> np.ndarray:
    """Return how far the cable lies from yaw at the start, (n,) [rad]; NaN where it is slack."""
    x, y = logs.start_m.T
    apart = np.hypot(x, y) / logs.cable.length_m
    taut = (apart > limits.LIKELY_TAUT) & (apart < 1 + limits.MOST_BEYOND)
    angle = np.arctan2(y, x) - logs.tool.values[logs.tool.first, 2]
    return np.where(taut, np.angle(np.exp(1j * angle)), np.nan)


def tool_log(logs: Logs, found: Findings) -> None:
    """The tool's log shows the whole motion: no hole, no jump, at rest when it begins and ends."""
    log = logs.tool
    t_s, dt_s, moved_m, turned = log.t_s, log.dt_s, log.moved_m, np.abs(log.turned_rad)
    gap = (dt_s > max(limits.GAPS * log.spacing_s, limits.GAP_S)) & (moved_m > limits.MOVED_M)
    wide = log.row_of_most(np.where(gap, dt_s, 0.0))
    moving = (t_s > logs.starts_s[log.cast]) & (t_s <= logs.stops_s[log.cast])
    stale = float(np.mean((moved_m == 0) & (turned == 0), where=moving)) if moving.any() else 0.0
    updated_s = log.spacing_s / max(1 - stale, 1e-9)
    found.doubt(
        stale < limits.STALE,
        stale < limits.STALE or updated_s <= limits.MOST_SPACING_S,
        "tool",
        f"{100 * stale:.0f} % of the samples repeat the pose before them while the tool moves: it "
        f"was updated every {updated_s:.2g} s, and is late by half of that",
    )
    jump = jumps(logs) & (stale < limits.STALE)
    worst = log.row_of_most(np.where(jump, moved_m + turned, 0.0))
    begins, ends = (
        np.maximum(log.speed_m_s[rows] - limits.MOST_M_S2 * dt_s[rows], 0.0)
        for rows in (log.first + 1, log.last)
    )
    for bad, say in (
        (
            log.most(gap),
            lambda i: (
                f"no sample from t = {t_s[wide[i] - 1]:.3f} to {t_s[wide[i]]:.3f} s, while the "
                f"tool moves {moved_m[wide[i]]:.2f} m"
            ),
        ),
        (
            log.most(jump),
            lambda i: (
                f"the tool jumps at t = {t_s[worst[i]]:.3f} s by {moved_m[worst[i]]:.2f} m and "
                f"{turned[worst[i]]:.2f} rad in {dt_s[worst[i]]:.3f} s, as no arm can"
            ),
        ),
        (log.most(logs.from_start_m) < limits.MOVED_M, lambda i: "the tool does not move"),
        (
            np.maximum(begins, ends) > limits.RUNNING_M_S,
            lambda i: (
                f"the log {'begins' if begins[i] > ends[i] else 'ends'} while the tool moves at "
                f"{max(begins[i], ends[i]):.2f} m/s"
            ),
        ),
    ):
        found.casts(Outcome.UNUSABLE, "tool", logs, bad, say)


def jumps(logs: Logs) -> np.ndarray:
    """Tell in which rows of the tool log the pose is not where an arm could bring it, (N,)."""
    log, turned = logs.tool, np.abs(logs.tool.turned_rad)
    jump = (log.steps(log.speed_m_s) > limits.JUMP_M_S) & (log.moved_m > limits.MOVED_M)
    return jump | (turned > limits.JUMP_RAD_S * log.dt_s) & (turned > limits.NEAR_RAD)


def clocks(logs: Logs, found: Findings) -> None:
    """Camera and tool saw the same motion on one clock."""
    end, cast, noise_m = logs.end, logs.end.cast, limits.NOISE_SD * logs.noise_m
    until_s = logs.stops_s + logs.measured.period_s
    shared = (end.t_s >= logs.starts_s[cast]) & (end.t_s <= until_s[cast])
    away_m = np.linalg.norm(end.values - end.values[end.first[cast]], axis=1)
    early = (end.t_s < logs.starts_s[cast] - limits.EARLY_S) & (away_m > limits.EARLY_M + noise_m)
    ends_s = logs.tool.t_s[logs.tool.last]
    late = logs.end_speed_m_s > limits.COASTING_M_S + noise_m / REST_OVER_S
    late &= end.t_s > ends_s[cast] + limits.COAST_S
    seen = np.add.reduceat(shared.astype(int), end.first)
    moves_m = end.most(away_m)[seen >= limits.FEWEST_WAYPOINTS]
    found.refuse(
        len(moves_m) and np.median(moves_m) < limits.EARLY_M,
        "waypoints",
        "in half of the casts the free end does not move, and the tool does; are x and y in m?",
    )
    for bad, say in (
        (
            seen < limits.FEWEST_WAYPOINTS,
            lambda i: f"fewer than {limits.FEWEST_WAYPOINTS} lie in the time of the tool's motion",
        ),
        (
            end.most(early),
            lambda i: f"the free end moves before the tool, at t = {logs.starts_s[i]:.2f} s",
        ),
        (
            end.most(late),
            lambda i: (
                f"the free end still moves more than {limits.COAST_S:g} s after the tool log "
                f"ended at t = {ends_s[i]:.2f} s: the log is cut, or the clocks do not agree"
            ),
        ),
    ):
        found.casts(Outcome.UNUSABLE, "waypoints", logs, bad, say)


def tracking(logs: Logs, found: Findings) -> None:
    """Waypoints are seen anew in every frame, and are of one cast alone."""
    end = logs.end
    differ = np.abs(np.diff(end.values, axis=0))
    digit_m = float(differ[differ > 0].min(initial=np.inf))
    same = (end.dt_s > 0) & (end.moved_m == 0) & (logs.noise_m > limits.FROZEN_DIGITS * digit_m)
    counted = np.cumsum(same)
    run = counted - np.maximum.accumulate(np.where(same, 0, counted))
    rows = end.row_of_most(run)
    seen: dict[bytes, int] = {}
    places = [trial.waypoints_m.tobytes() for trial in logs.trials]
    first = np.array([seen.setdefault(place, i) for i, place in enumerate(places)])
    for bad, say in (
        (
            end.most(run) >= limits.FROZEN - 1,
            lambda i: (
                f"one place is repeated to the last digit {run[rows[i]] + 1} times up to t = "
                f"{end.t_s[rows[i]]:.2f} s: the tracker was frozen"
            ),
        ),
        (
            first < np.arange(len(first)),
            lambda i: (
                f"they are those of trial {logs.trials[first[i]].trial} to the last digit, and a "
                "copy is no repeat"
            ),
        ),
    ):
        found.casts(Outcome.UNUSABLE, "waypoints", logs, bad, say)


def rest(logs: Logs, found: Findings) -> None:
    """An endpoint counts where the free end was seen at rest, and the tool with it."""
    last, tool_end = logs.end.last, logs.tool.values[logs.tool.last, :2]
    speed, noise_m = logs.end_speed_m_s, limits.NOISE_SD * logs.noise_m
    fast = limits.REST_M_S + noise_m / REST_OVER_S
    left_m = np.linalg.norm(logs.held_m[last] - tool_end, axis=1)
    until_s, cast = logs.end.t_s[last], logs.end.cast
    # at rest with the tool, and then fast again: something else was followed
    again = (speed > 2 * fast) & (logs.end.t_s > logs.stops_s[cast] + limits.COAST_S / 2)
    again &= logs.end.steps(speed) > fast
    at = logs.end.row_of_most(again)
    moves, moves_on, away = speed[last] > fast, left_m > limits.MOVED_M, logs.end.most(again)
    for bad, say in (
        (
            moves,
            lambda i: (
                f"the free end moves at {speed[last[i]]:.2f} m/s where it is seen last, at t = "
                f"{until_s[i]:.2f} s"
            ),
        ),
        (
            moves_on & ~moves,
            lambda i: (
                f"the free end is seen last at t = {until_s[i]:.2f} s, and the tool moves on by "
                f"{left_m[i]:.2f} m"
            ),
        ),
        (
            away & ~moves & ~moves_on,
            lambda i: (
                f"the free end is away at {speed[at[i]]:.1f} m/s at t = "
                f"{logs.end.t_s[at[i]]:.2f} s, long after the tool came to rest"
            ),
        ),
        (
            np.array([not t.rested for t in logs.trials]) & ~(moves | moves_on | away),
            lambda i: "its free end was not seen at rest, as rested of its action says",
        ),
    ):
        found.casts(Outcome.UNRESTED, "waypoints", logs, bad, say)


RULES = (period, told, yaw, tool_log, clocks, frame, length, cable, tracking, rest)
