"""What both packages use: documents from outside as records. Nothing of a robot."""
