#!/bin/sh
# Stands in for ffmpeg in tests: fails before it reads anything, with two lines on stderr.
echo 'Some detail' >&2
echo 'Unable to choose an output format' >&2
exit 1
