"""What does a stranger's axis lack?  Drawn axes as logs and files, put to the commands."""
