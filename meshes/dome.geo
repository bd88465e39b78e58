// A block 2 x 2 x 1, z up, pressed on a spherical foundation below its middle (a gap, see the demos).
SetFactory("OpenCASCADE");
Box(1) = {-1, -1, 0, 2, 2, 1};
e = 1e-3;
left() = Surface In BoundingBox {-1 - e, -1 - e, -e, -1 + e, 1 + e, 1 + e};
right() = Surface In BoundingBox {1 - e, -1 - e, -e, 1 + e, 1 + e, 1 + e};
front() = Surface In BoundingBox {-1 - e, -1 - e, -e, 1 + e, -1 + e, 1 + e};
back() = Surface In BoundingBox {-1 - e, 1 - e, -e, 1 + e, 1 + e, 1 + e};
bottom() = Surface In BoundingBox {-1 - e, -1 - e, -e, 1 + e, 1 + e, e};
top() = Surface In BoundingBox {-1 - e, -1 - e, 1 - e, 1 + e, 1 + e, 1 + e};
Physical Surface("left", 1) = left();
Physical Surface("right", 2) = right();
Physical Surface("front", 3) = front();
Physical Surface("back", 4) = back();
Physical Surface("bottom", 5) = bottom();
Physical Surface("top", 6) = top();
Physical Volume("body", 1) = {1};
Mesh.MeshSizeMax = 0.4;
