"""One thin file per verb: parse, call, print, return a code. Anything heavy is imported inside the functions."""
