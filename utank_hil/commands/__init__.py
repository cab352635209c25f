"""The commands of ``utank-hil``, one file each."""
