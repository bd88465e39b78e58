// An L-shaped bracket of steel, mm: foot on y = 0, wall at x = 0, a fillet between the legs, a bolt hole in each.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 80, 20};
Rectangle(2) = {0, 0, 0, 20, 80};
BooleanUnion(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
// the fillet, of radius 12: a square less a disc
Rectangle(4) = {20, 20, 0, 12, 12};
Disk(5) = {32, 32, 0, 12};
BooleanDifference(6) = { Surface{4}; Delete; }{ Surface{5}; Delete; };
BooleanUnion(7) = { Surface{3}; Delete; }{ Surface{6}; Delete; };
Disk(8) = {62, 10, 0, 5};
Disk(9) = {10, 62, 0, 5};
BooleanDifference(10) = { Surface{7}; Delete; }{ Surface{8, 9}; Delete; };
e = 1e-3;
foot() = Curve In BoundingBox {-e, -e, -e, 80 + e, e, e};
wall() = Curve In BoundingBox {-e, -e, -e, e, 80 + e, e};
holes() = Curve In BoundingBox {57 - e, 5 - e, -e, 67 + e, 15 + e, e};
holes() += Curve In BoundingBox {5 - e, 57 - e, -e, 15 + e, 67 + e, e};
free() = Boundary { Surface{10}; };
free() -= {foot(), -foot(), wall(), -wall(), holes(), -holes()};
Physical Curve("foot", 1) = foot();
Physical Curve("wall", 2) = wall();
Physical Curve("holes", 3) = holes();
Physical Curve("free", 4) = free();
Physical Surface("body", 1) = {10};
Mesh.MeshSizeMax = 8;
Mesh.MeshSizeFromCurvature = 12;
