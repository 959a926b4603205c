"""Generate D_sim for one cable with its tuned simulator, whole or one shard of it.

The tool moves as the arm followed its plans in the casts that the simulator was tuned to, and the
cable starts where their resets left it on average.
"""

from omegaconf import DictConfig

from robotcast.stage import stage, tell
from robotcast.workflow.generating import generate_d_sim


def generate(config: DictConfig) -> None:
    folder, generated = generate_d_sim(config)
    lost = int(generated.diverged.sum())
    tell(f"{folder}: {len(generated.actions) - lost} casts, {lost} diverged and were left out")


if __name__ == "__main__":
    stage(generate)()
