"""A robot's MJCF beside its logs, as diagnosis sees them.

`robot_file` reads robot.yaml, `logs` the recorded signals, `windows` cuts them into trials with
start states and noise, `rollout` simulates all of them under many parameter vectors at once, and
`effects` holds what a robot's model may lack.
"""
