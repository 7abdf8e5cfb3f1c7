"""Remaining life by five models on every run, five seeds each: tables 3 and 5 and figures 3 to 14."""
