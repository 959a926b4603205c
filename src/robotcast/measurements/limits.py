"""What real cables, arms and cameras can do: every threshold of the rules, with its reason."""

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
# Decimals that a table was rounded to; no tracker repeats a whole path to a micrometre.
FEWEST_DIGITS, MOST_DIGITS, SAME_M = 2, 7, 1e-6
REST_M_S = 0.25  # from there friction of 0.2 stops the end within 16 mm
