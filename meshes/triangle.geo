// The triangle whose contact problem has a continuum of solutions at friction 2 (nu = 0.2, E = 1.2; P. Hild 2004).
size = 0.2;
Point(1) = {0, 0, 0, size};
Point(2) = {1, 0, 0, size};
Point(3) = {0.4, 0.3, 0, size};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 1};
Curve Loop(1) = {1, 2, 3};
Plane Surface(1) = {1};
Physical Curve("foot", 1) = {1};
Physical Curve("pulled", 2) = {2};
Physical Curve("held", 3) = {3};
Physical Surface("body", 1) = {1};
