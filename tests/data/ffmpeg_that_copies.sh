#!/bin/sh
# Stands in for ffmpeg in tests: writes what it reads to the file that is its last argument. Like ffmpeg,
# it opens that file once it has read something, since the folder may not exist before.
for last in "$@"; do :; done
first=$(dd bs=1 count=1 2>/dev/null)
{
    printf %s "$first"
    cat
} >"${last#file:}"
