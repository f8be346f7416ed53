"""From a corrected machine to the part: process, toolpath, milling, chatter, compensation."""
