"""What a study is to be: its plan, checked, and the order of each participant's rounds."""
