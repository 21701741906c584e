"""The command line, behind the console script ``thetahat``."""

import sys

from thetahat._thetahat import run


def main() -> int:
    """Run the program on the arguments of this process and return its exit code."""
    return run(sys.argv)
