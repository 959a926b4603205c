"""Generate D_sim for one cable with its tuned simulator: whole, one shard of it, or of all shards.

python stages/generate.py -m generate.shards=4 'generate.shard=range(4)'
python stages/generate.py generate.shards=4   # put together, the bytes of a run in one piece
"""

from omegaconf import DictConfig

from robotcast.stage import stage, tell
from robotcast.workflow.generating import generate_d_sim, merge_d_sim


def generate(config: DictConfig) -> None:
    if config.generate.shard is None and config.generate.shards > 1:
        folder, facts = merge_d_sim(config)
        of = f" of {config.generate.shards} shards"
    else:
        (folder, facts), of = generate_d_sim(config), ""
    lost = facts["diverged"]
    tell(f"{folder}: {facts['casts']} casts{of}, {lost} diverged and were left out")


if __name__ == "__main__":
    stage(generate)()
