// Semicircular arch, centreline radius 1 m, thickness 0.15 m, 12 voussoirs over 180 degrees.
// Each voussoir is a quadrilateral with its four corners on the circles; every block has points of its own,
// so that the joints stay joints: blocks that only touch share nothing.
// Made into semicircular_arch.msh by:  gmsh -2 -format msh41 semicircular_arch.geo -o semicircular_arch.msh
radius = 1.0;      // m
thickness = 0.15;  // m
n = 12;
inner = radius - thickness / 2;
outer = radius + thickness / 2;
size = 0.5;        // coarse: only the outlines matter

Macro Quadrilateral
  p = newp; Point(p) = {x1, y1, 0, size};
  Point(p + 1) = {x2, y2, 0, size};
  Point(p + 2) = {x3, y3, 0, size};
  Point(p + 3) = {x4, y4, 0, size};
  l = newl; Line(l) = {p, p + 1};
  Line(l + 1) = {p + 1, p + 2};
  Line(l + 2) = {p + 2, p + 3};
  Line(l + 3) = {p + 3, p};
  c = newll; Curve Loop(c) = {l, l + 1, l + 2, l + 3};
  s = news; Plane Surface(s) = {c};
Return

// Voussoirs from the right springing to the left one. At the springings sin(Pi) is not exactly 0 in binary.
voussoirs[] = {};
For i In {0 : n - 1}
  a = Pi * i / n;
  b = Pi * (i + 1) / n;
  sb = Sin(b);
  If (i == n - 1)
    sb = 0;
  EndIf
  x1 = inner * Cos(a); y1 = inner * Sin(a);
  x2 = outer * Cos(a); y2 = outer * Sin(a);
  x3 = outer * Cos(b); y3 = outer * sb;
  x4 = inner * Cos(b); y4 = inner * sb;
  Call Quadrilateral;
  voussoirs[] += {s};
EndFor

// Springers, wider than the joint and 0.2 m deep.
x1 = 0.75; y1 = -0.2; x2 = 1.25; y2 = -0.2; x3 = 1.25; y3 = 0; x4 = 0.75; y4 = 0;
Call Quadrilateral;
right = s;
x1 = -1.25; y1 = -0.2; x2 = -0.75; y2 = -0.2; x3 = -0.75; y3 = 0; x4 = -1.25; y4 = 0;
Call Quadrilateral;
left = s;

Physical Surface("voussoirs") = {voussoirs[]};
Physical Surface("left springer") = {left};
Physical Surface("right springer") = {right};
