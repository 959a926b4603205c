"""Follow what runs here on one page, which this machine alone is served: [watch.port=N]"""

from pathlib import Path

from omegaconf import DictConfig

from robotcast.stage import stage, tell
from robotcast.watch import HOST, serve


def watch(config: DictConfig) -> None:
    port = config.watch.port
    tell(f"open http://{HOST}:{port} (interrupt ends it)")
    try:
        serve(Path(), Path(config.paths.running), port)
    except OSError as error:
        raise ValueError(f"port {port}: {error.strerror}; choose another, watch.port=N") from None


if __name__ == "__main__":
    stage(watch)()
