"""`python -m robot_dyn` is the command line."""

from robot_dyn.cli import main

if __name__ == "__main__":
    main()
