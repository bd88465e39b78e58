// Compressed and pushed block, half model in mm (GRECO benchmark, code_aster SSNV128).
size = 5;
Point(1) = {0, 0, 0, size};
Point(2) = {40, 0, 0, size};
Point(3) = {40, 40, 0, size};
Point(4) = {0, 40, 0, size};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Physical Curve("bottom", 1) = {1};
Physical Curve("right", 2) = {2};
Physical Curve("top", 3) = {3};
Physical Curve("left", 4) = {4};
Physical Surface("body", 1) = {1};
