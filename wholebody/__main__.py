"""`python -m wholebody` is the command `wholebody`."""

from wholebody.cli.main import main

if __name__ == "__main__":
    main()
