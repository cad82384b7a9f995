"""The commands of ``testbench``, a group a file; what a command needs is imported when it is called."""
