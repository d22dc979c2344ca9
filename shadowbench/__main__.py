"""Run the command line as ``python -m shadowbench``."""

from shadowbench.cli import main

if __name__ == "__main__":
    main()
