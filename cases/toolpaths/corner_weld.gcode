; a seam around a corner, in millimetres and millimetres a minute
G21 G90 G17
G0 X10 Y15
M3 S2400          ; arc on, 2400 W
G1 X35 F360
G3 X45 Y25 I0 J10
G1 Y50
M5                ; arc off
M30
