"""Merge the shards of one cable's D_sim into the bytes of an unsharded run.

python stages/generate.py -m generate.shards=4 'generate.shard=range(4)'
python stages/merge_shards.py generate.shards=4
"""

from pathlib import Path

from omegaconf import DictConfig

from robotcast.simulators.d_sim import Shard, merge_shards
from robotcast.stage import output_folder, stage, tell


def merge(config: DictConfig) -> None:
    of = config.generate.shards
    shards = [Path(config.paths.shards) / Shard(number, of).name for number in range(of)]
    folder = output_folder(config.paths.simulated)
    facts = merge_shards(shards, folder)
    tell(f"{folder}: {facts['casts']} casts of {of} shards, {facts['diverged']} had diverged")


if __name__ == "__main__":
    stage(merge)()
