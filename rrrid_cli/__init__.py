"""The command line of rrrid: parse, call one stage, print, exit."""
