"""Makes the Python types of the LCM messages from proto/*.lcm: python -m carom.build_messages.

They go into <environment>/messages, where carom looks for them.  The generator is the one of the
`lcm` wheel: the lcm-gen 1.3.1 of Debian writes Python that does not run.
"""

import argparse
import subprocess
import sys
from pathlib import Path

PROTO = Path(__file__).resolve().parents[3] / "proto"


def default_folder():
    """Where the messages of this Python environment are kept."""
    return Path(sys.prefix) / "messages"


def find_generator():
    """The lcm-gen that was installed with the lcm wheel of this environment."""
    for folder in (Path(sys.executable).parent, Path(sys.prefix) / "bin"):
        if (folder / "lcm-gen").exists():
            return folder / "lcm-gen"
    raise SystemExit(f"no lcm-gen beside {sys.executable}: install the lcm wheel with pip")


def build(proto, folder):
    """Writes the package `carom` of message types into the folder."""
    files = sorted(Path(proto).glob("*.lcm"))
    if not files:
        raise SystemExit(f"no .lcm files in {proto}: give the folder of the messages with --proto")
    Path(folder).mkdir(parents=True, exist_ok=True)
    subprocess.run([find_generator(), "-p", "--ppath", folder, *files], check=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--proto", default=PROTO, help="folder of the .lcm files")
    parser.add_argument("--out", default=default_folder(), help="folder for the types")
    arguments = parser.parse_args()
    build(arguments.proto, arguments.out)
    print(f"messages in {arguments.out}")


if __name__ == "__main__":
    main()
