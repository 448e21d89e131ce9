// The meshes and files that people really have, of each kind a small one, from file to answer: what the command bakes
// and verifies is asked for points of the solid that the file describes, which are known without any code of the
// builder: on its surface, edges and vertices, and inside by the solid angles of its faces.
#include "tests/scenes.hpp"

#include <prolate/shapes.hpp>
#include <prolate/tree.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <numbers>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

namespace prolate {
namespace {

namespace fs = std::filesystem;
using scenes::Point;
using scenes::Random;

// ---- solids ----

Point operator+(const Point& a, const Point& b) {
    return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
Point operator-(const Point& a, const Point& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Point operator*(double k, const Point& a) {
    return {k * a[0], k * a[1], k * a[2]};
}
double dot(const Point& a, const Point& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Point cross(const Point& a, const Point& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double length(const Point& a) {
    return std::sqrt(dot(a, a));
}

// Polygons as files have them, and the same surface as triangles, which only this test knows.
struct Solid {
    std::vector<Point> points;
    std::vector<std::vector<uint32_t>> polygons;
    std::vector<std::array<uint32_t, 3>> triangles;

    void add(std::vector<uint32_t> polygon) { // a convex one
        for (size_t i = 2; i < polygon.size(); ++i) triangles.push_back({polygon[0], polygon[i - 1], polygon[i]});
        polygons.push_back(std::move(polygon));
    }
    void append(const Solid& other) {
        const auto base = static_cast<uint32_t>(points.size());
        points.insert(points.end(), other.points.begin(), other.points.end());
        for (auto polygon : other.polygons) {
            for (uint32_t& i : polygon) i += base;
            polygons.push_back(std::move(polygon));
        }
        for (const auto& [a, b, c] : other.triangles) triangles.push_back({a + base, b + base, c + base});
    }
    double size() const {
        Point low = points[0], high = points[0];
        for (const Point& p : points)
            for (size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
        return length(high - low);
    }
    double volume() const {
        double six = 0;
        for (const auto& [a, b, c] : triangles) six += dot(points[a], cross(points[b], points[c]));
        return six / 6;
    }
    // How often the surface winds around p: the sum of the triangles' solid angles (van Oosterom and Strackee 1983).
    double winding(const Point& p) const {
        double sum = 0;
        for (const auto& [i, j, k] : triangles) {
            const Point a = points[i] - p, b = points[j] - p, c = points[k] - p;
            const double la = length(a), lb = length(b), lc = length(c);
            sum += 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
        }
        return sum / (4 * std::numbers::pi);
    }
};

Solid mapped(Solid solid, const std::function<Point(const Point&)>& map) {
    for (Point& p : solid.points) p = map(p);
    return solid;
}
Solid moved(Solid solid, const Point& by, double scale = 1) {
    return mapped(std::move(solid), [&](const Point& p) { return by + scale * p; });
}
Solid flipped(Solid solid) {
    for (auto& polygon : solid.polygons) std::reverse(polygon.begin(), polygon.end());
    for (auto& t : solid.triangles) std::swap(t[1], t[2]);
    return solid;
}
Solid joined(const std::vector<Solid>& parts) {
    Solid out;
    for (const Solid& part : parts) out.append(part);
    return out;
}

Solid box(const Point& low = {0, 0, 0}, const Point& high = {1, 1, 1}) {
    Solid out;
    for (uint32_t i = 0; i < 8; ++i)
        out.points.push_back({(i & 1 ? high : low)[0], (i & 2 ? high : low)[1], (i & 4 ? high : low)[2]});
    for (const auto& q : std::vector<std::vector<uint32_t>>{
             {0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}})
        out.add(q);
    return out;
}

// A surface over a grid of two angles, u around and v across, both closed.
Solid torus(double big, double small, uint32_t around, uint32_t across) {
    Solid out;
    for (uint32_t i = 0; i < around; ++i)
        for (uint32_t j = 0; j < across; ++j) {
            const double u = 2 * std::numbers::pi * i / around, v = 2 * std::numbers::pi * j / across;
            const double r = big + small * std::cos(v);
            out.points.push_back({r * std::cos(u), r * std::sin(u), small * std::sin(v)});
        }
    const auto at = [&](uint32_t i, uint32_t j) { return i % around * across + j % across; };
    for (uint32_t i = 0; i < around; ++i)
        for (uint32_t j = 0; j < across; ++j) {
            out.add({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            out.add({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    return out;
}

// A profile of radii and heights, turned about z; it begins and ends on the axis.
Solid turned(const std::vector<std::array<double, 2>>& profile, uint32_t sides) {
    Solid out;
    const auto last = static_cast<uint32_t>(profile.size()) - 1;
    out.points = {{0, 0, profile[0][1]}, {0, 0, profile[last][1]}};
    for (uint32_t r = 1; r < last; ++r)
        for (uint32_t i = 0; i < sides; ++i) {
            const double u = 2 * std::numbers::pi * i / sides;
            out.points.push_back({profile[r][0] * std::cos(u), profile[r][0] * std::sin(u), profile[r][1]});
        }
    const auto at = [&](uint32_t ring, uint32_t i) { return 2 + (ring - 1) * sides + i % sides; };
    for (uint32_t i = 0; i < sides; ++i) {
        out.add({0, at(1, i + 1), at(1, i)});
        for (uint32_t r = 1; r + 1 < last; ++r) {
            out.add({at(r, i), at(r, i + 1), at(r + 1, i + 1)});
            out.add({at(r, i), at(r + 1, i + 1), at(r + 1, i)});
        }
        out.add({1, at(last - 1, i), at(last - 1, i + 1)});
    }
    return out;
}
Solid ball(double radius = 1, uint32_t rings = 10) {
    std::vector<std::array<double, 2>> profile;
    for (uint32_t r = 0; r <= rings; ++r) {
        const double angle = std::numbers::pi * r / rings;
        profile.push_back({r % rings ? radius * std::sin(angle) : 0, -radius * std::cos(angle)});
    }
    return turned(profile, 2 * rings);
}
Solid cylinder(double radius, double height) {
    return turned({{0, 0}, {radius, 0}, {radius, height}, {0, height}}, 12);
}

Solid grid(uint32_t n) {
    Solid out;
    for (uint32_t i = 0; i <= n; ++i)
        for (uint32_t j = 0; j <= n; ++j) out.points.push_back({double(i) / n, double(j) / n, 0});
    for (uint32_t i = 0; i < n; ++i)
        for (uint32_t j = 0; j < n; ++j) {
            const uint32_t a = i * (n + 1) + j, b = a + n + 1;
            out.add({a, b, b + 1, a + 1});
        }
    return out;
}

// A comb, its two caps one concave polygon each; as triangles, the caps are a bar and teeth.
Solid comb(Random& random, uint32_t teeth) {
    std::vector<std::array<double, 2>> outline{{0, 0}, {2.0 * teeth - 1, 0}};
    for (uint32_t t = teeth; t-- > 0;) {
        const double x = 2.0 * t, height = random.in(1, 3);
        outline.insert(outline.end(), {{x + 1, height}, {x, height}});
        if (t > 0) outline.insert(outline.end(), {{x, 0.5}, {x - 1, 0.5}});
    }
    const auto n = static_cast<uint32_t>(outline.size());
    Solid out;
    const Quat turn = random.rotation();
    for (const double z : {0.0, 1.0})
        for (const auto& [x, y] : outline) out.points.push_back(scenes::rotate(turn, {x, y, z}));
    std::vector<uint32_t> bottom, top;
    for (uint32_t i = 0; i < n; ++i) bottom.push_back(n - 1 - i), top.push_back(n + i);
    for (uint32_t i = 0; i < n; ++i) out.add({i, (i + 1) % n, n + (i + 1) % n, n + i});
    out.polygons.push_back(bottom), out.polygons.push_back(top);
    // Of tooth t, the top corners are right, left, and then the notch's left of it, right one first.
    const auto corner = [&](uint32_t tooth, uint32_t k) { return 2 + 4 * (teeth - 1 - tooth) + k; };
    const auto cap = [&](uint32_t a, uint32_t b, uint32_t c) {
        out.triangles.push_back({n + a, n + b, n + c}), out.triangles.push_back({a, c, b});
    };
    for (uint32_t t = 0; t < teeth; ++t) { // from the foot on; feet of the outer teeth are the outline's lower corners
        const uint32_t right = t + 1 < teeth ? corner(t + 1, 3) : 1, left = t > 0 ? corner(t, 2) : 0;
        cap(left, right, corner(t, 0)), cap(left, corner(t, 0), corner(t, 1));
    }
    // The bar below: a fan from the first corner over the feet.
    std::vector<uint32_t> feet{1};
    for (uint32_t t = teeth - 1; t > 0; --t) feet.push_back(corner(t, 2)), feet.push_back(corner(t, 3));
    for (size_t i = 0; i + 1 < feet.size(); ++i) cap(0, feet[i], feet[i + 1]);
    return out;
}

// ---- files ----

std::string obj(const Solid& s) {
    std::ostringstream out;
    out.precision(9);
    for (const Point& p : s.points) out << "v " << p[0] << ' ' << p[1] << ' ' << p[2] << '\n';
    for (const auto& polygon : s.polygons) {
        out << 'f';
        for (const uint32_t i : polygon) out << ' ' << i + 1;
        out << '\n';
    }
    return out.str();
}

// The part that off and ply have in common.
std::string listed(const Solid& s) {
    std::ostringstream out;
    out.precision(9);
    for (const Point& p : s.points) out << p[0] << ' ' << p[1] << ' ' << p[2] << '\n';
    for (const auto& polygon : s.polygons) {
        out << polygon.size();
        for (const uint32_t i : polygon) out << ' ' << i;
        out << '\n';
    }
    return out.str();
}
std::string off(const Solid& s) {
    return "OFF\n" + std::to_string(s.points.size()) + ' ' + std::to_string(s.polygons.size()) + " 0\n" + listed(s);
}
std::string ply(const Solid& s) {
    return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(s.points.size()) +
           "\nproperty float x\nproperty float y\nproperty float z\nelement face " + std::to_string(s.polygons.size()) +
           "\nproperty list uchar int vertex_indices\nend_header\n" + listed(s);
}

template <class T> void append(std::string& bytes, T value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}
void append(std::string& bytes, const Point& p) {
    for (const double x : p) append(bytes, static_cast<float>(x));
}

// Binary, one corner of one triangle off by `jitter` in x.
std::string stl(const Solid& s, double jitter) {
    std::string out(80, '\0');
    append(out, static_cast<uint32_t>(s.triangles.size()));
    for (const auto& t : s.triangles) {
        append(out, Point{});
        for (const uint32_t i : t) append(out, s.points[i] + Point{std::exchange(jitter, 0), 0, 0});
        append(out, uint16_t{0});
    }
    return out;
}

std::string base64(const std::string& bytes) {
    const char* const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (size_t i = 0; i < bytes.size(); i += 3) {
        uint32_t group = 0;
        for (size_t k = 0; k < 3; ++k)
            group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : digits[group >> (18 - 6 * k) & 63];
    }
    return out;
}

// `nodes` is the array of the scene's nodes; `extension` is said to be required. Quantised positions are 16-bit parts
// of the unit cube's sides. `instances` are translations in a third accessor.
std::string gltf(const Solid& s, const std::string& nodes, uint32_t roots, const std::string& extension = "",
                 const std::vector<Point>& instances = {}) {
    const bool quantised = extension == "KHR_mesh_quantization";
    std::string data;
    for (const Point& p : s.points) {
        if (!quantised) {
            append(data, p);
            continue;
        }
        for (const double x : p) append(data, static_cast<uint16_t>(std::lround(65535 * x)));
        append(data, uint16_t{0});
    }
    const size_t indices = data.size();
    for (const auto& t : s.triangles)
        for (const uint32_t i : t) append(data, static_cast<uint16_t>(i));
    data.resize((data.size() + 3) / 4 * 4);
    const size_t translations = data.size();
    for (const Point& p : instances) append(data, p);
    std::ostringstream out;
    out << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0)";
    for (uint32_t i = 1; i < roots; ++i) out << ',' << i;
    out << R"(]}],"nodes":)" << nodes
        << R"(,"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"accessors":[{"bufferView":0,"count":)"
        << s.points.size() << R"(,"type":"VEC3",)"
        << (quantised ? R"("componentType":5123,"normalized":true,"min":[0,0,0],"max":[65535,65535,65535]})"
                      : R"("componentType":5126,"min":[-9,-9,-9],"max":[9,9,9]})")
        << R"(,{"bufferView":1,"componentType":5123,"type":"SCALAR","count":)" << 3 * s.triangles.size() << '}';
    if (!instances.empty())
        out << R"(,{"bufferView":2,"componentType":5126,"type":"VEC3","count":)" << instances.size() << '}';
    out << R"(],"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":)" << indices
        << (quantised ? R"(,"byteStride":8)" : "") << R"(},{"buffer":0,"byteOffset":)" << indices << R"(,"byteLength":)"
        << 6 * s.triangles.size() << '}';
    if (!instances.empty())
        out << R"(,{"buffer":0,"byteOffset":)" << translations << R"(,"byteLength":)" << 12 * instances.size() << '}';
    out << R"(],"buffers":[{"byteLength":)" << data.size() << R"(,"uri":"data:application/octet-stream;base64,)"
        << base64(data) << "\"}]";
    if (!extension.empty())
        out << R"(,"extensionsUsed":[")" << extension << R"("],"extensionsRequired":[")" << extension << "\"]";
    out << '}';
    return out.str();
}

std::string dae(const Solid& s, const char* metre) {
    std::ostringstream out;
    out.precision(9);
    out << R"(<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>)"
        << R"(<unit name="u" meter=")" << metre << R"("/><up_axis>Z_UP</up_axis></asset><library_geometries>)"
        << R"(<geometry id="g"><mesh><source id="p"><float_array id="a" count=")" << 3 * s.points.size() << "\">";
    for (const Point& p : s.points) out << p[0] << ' ' << p[1] << ' ' << p[2] << ' ';
    out << R"(</float_array><technique_common><accessor source="#a" count=")" << s.points.size()
        << R"(" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>)"
        << R"(</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>)"
        << R"(<triangles count=")" << s.triangles.size() << R"("><input semantic="VERTEX" source="#v" offset="0"/><p>)";
    for (const auto& [a, b, c] : s.triangles) out << a << ' ' << b << ' ' << c << ' ';
    out << "</p></triangles></mesh></geometry></library_geometries><library_visual_scenes><visual_scene id=\"s\">"
           "<node id=\"n\"><instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes><scene>"
           "<instance_visual_scene url=\"#s\"/></scene></COLLADA>";
    return out.str();
}

// ---- cases ----

struct Case {
    std::string file;     // its name
    std::string content;  // and what it holds
    Solid solid;          // which is this
    bool closed = true;   // it bounds a solid
    double within = 2e-6; // of its size: how far points may move on their way, most of it by rounding to floats
};
void PrintTo(const Case& c, std::ostream* out) {
    *out << c.file;
}

Case as_obj(const char* name, Solid solid, bool closed = true) {
    std::string content = obj(solid);
    return {name, std::move(content), std::move(solid), closed};
}

std::vector<Case> cases() {
    std::vector<Case> out;
    Random random(1);
    out.push_back(as_obj("hollow.obj", joined({ball(), flipped(ball(0.9))})));
    Solid loose, open;
    for (int i = 0; i < 40; ++i) loose.append(moved(box(), {random.unit(), random.unit(), random.unit()}, 0.05));
    out.push_back(as_obj("loose.obj", loose));
    out.push_back(as_obj("needle.obj", cylinder(1e-3, 1)));
    out.push_back(as_obj("floor.obj", grid(1), false));
    out.push_back(as_obj("grid.obj", grid(12), false));
    out.push_back(as_obj("cube.obj", box()));
    out.push_back(as_obj("sheet.obj", box({0, 0, 0}, {1, 1, 1e-4})));
    out.push_back(as_obj("plate.obj", box({-5, -5, 0}, {5, 5, 1e-3})));
    out.push_back(as_obj("inside_out.obj", flipped(ball())));
    out.push_back(as_obj("far.obj", moved(torus(1, 0.3, 16, 8), {20, -30, 10})));
    out.push_back(as_obj("tiny.obj", mapped(torus(1, 0.3, 16, 8), [](const Point& p) { return 1e-5 * p; })));
    out.push_back(as_obj("ball_in_shell.obj", joined({ball(), ball(2.2), flipped(ball(1.1))})));
    open = joined({torus(1, 0.3, 12, 8), moved(ball(), {3, 0, 0})});
    std::erase_if(open.triangles, [n = 0](const auto&) mutable { return n++ % 40 == 0; });
    open.polygons.clear();
    for (const auto& [a, b, c] : open.triangles) open.polygons.push_back({a, b, c});
    out.push_back(as_obj("open.obj", open, false));
    for (uint32_t i = 0; i < 9; ++i) { // how a polygon is cut depends on how it lies
        const Solid s = comb(random, 5);
        const std::string name = "comb" + std::to_string(i);
        const bool as_ply = i % 3 == 1, as_off = i % 3 == 2;
        out.push_back({name + (as_ply   ? ".ply"
                               : as_off ? ".off"
                                        : ".obj"),
                       as_ply   ? ply(s)
                       : as_off ? off(s)
                                : obj(s),
                       s});
    }
    out.push_back({"welded.stl", stl(torus(1, 0.3, 16, 8), 0), torus(1, 0.3, 16, 8)});
    out.push_back({"near_weld.stl", stl(box(), 2e-8), box()});
    const Solid part = box({1, 0, 0}, {2, 3, 1}), mirror = flipped(mapped(part, [](const Point&p) {
                                                      return Point{-p[0], p[1], p[2]};
                                                  }));
    out.push_back({"plain.gltf", gltf(part, R"([{"mesh":0}])", 1), part});
    out.push_back(
        {"mirrored.gltf", gltf(part, R"([{"mesh":0},{"mesh":0,"scale":[-1,1,1]}])", 2), joined({part, mirror})});
    const Solid unit = mapped(torus(1, 0.3, 16, 8), [](const Point& p) {
        return Point{(p[0] + 1.3) / 2.6, (p[1] + 1.3) / 2.6, (p[2] + 0.3) / 0.6};
    });
    out.push_back({"quantised.gltf", gltf(unit, R"([{"mesh":0,"scale":[2.6,2.6,0.6]}])", 1, "KHR_mesh_quantization"),
                   moved(torus(1, 0.3, 16, 8), {1.3, 1.3, 0.3}), true, 2e-5});
    const std::vector<Point> places{{0, 0, 0}, {5, 0, 0}, {0, 5, 0}};
    out.push_back(
        {"instanced.gltf",
         gltf(part, R"([{"mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":2}}}}])", 1,
              "EXT_mesh_gpu_instancing", places),
         joined({part, moved(part, places[1]), moved(part, places[2])})});
    out.push_back({"metres.dae", dae(part, "1"), part});
    return out;
}

// ---- the check ----

struct Samples {
    std::vector<Point> surface, inside, outside;
};
Samples samples(const Case& c) {
    Random random(7);
    Samples out;
    const Solid& s = c.solid;
    double area = 0;
    const auto area_of = [&](const auto& t) {
        return length(cross(s.points[t[1]] - s.points[t[0]], s.points[t[2]] - s.points[t[0]]));
    };
    for (const auto& t : s.triangles) area += area_of(t);
    for (const auto& t : s.triangles) {
        for (const uint32_t i : t) out.surface.push_back(s.points[i]);
        for (size_t k = 0; k < 3; ++k) {
            const Point &a = s.points[t[k]], &b = s.points[t[(k + 1) % 3]];
            out.surface.push_back(a + random.unit() * (b - a));
        }
        const auto count = static_cast<uint32_t>(200 * area_of(t) / area + random.unit());
        for (uint32_t n = 0; n < count; ++n) {
            double u = random.unit(), v = random.unit();
            if (u + v > 1) u = 1 - u, v = 1 - v;
            const Point& a = s.points[t[0]];
            out.surface.push_back(a + u * (s.points[t[1]] - a) + v * (s.points[t[2]] - a));
        }
    }
    if (!c.closed) return out;
    Point low = s.points[0], high = low;
    for (const Point& p : s.points)
        for (size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
    for (uint32_t n = 0; n < 200; ++n) {
        const Point p{random.in(low[0], high[0]), random.in(low[1], high[1]), random.in(low[2], high[2])};
        (std::abs(s.winding(p)) > 0.5 ? out.inside : out.outside).push_back(p);
    }
    return out;
}

// Points that lie in no ellipsoid of the cut, nor nearer to one than `within`.
ptrdiff_t uncovered(const TreeView& tree, uint32_t level, const std::vector<Point>& points, double within) {
    std::vector<std::pair<Ellipsoid, double>> cut; // with the radial coordinate that is near enough, squared
    tree.for_each_in_cut(level, [&](uint32_t node) {
        const Ellipsoid e = tree.ellipsoid(node);
        const double radius = 1 + within / principal_axes(e).radii[2];
        cut.emplace_back(e, radius * radius);
    });
    return std::count_if(points.begin(), points.end(), [&](const Point& p) {
        return std::none_of(cut.begin(), cut.end(),
                            [&](const auto& e) { return radial_squared(e.first, p.data()) <= e.second; });
    });
}

// Points that the body does not meet, nor comes nearer to than `within`.
ptrdiff_t apart(const TreeView& tree, const std::vector<Point>& points, double within) {
    QueryContext context;
    return std::count_if(points.begin(), points.end(), [&](const Point& p) {
        const Sphere sphere{scenes::to_float(p), static_cast<float>(within)};
        return overlap(tree, {}, sphere, context).verdict == Verdict::separated;
    });
}

double volume(const TreeView& tree, const Point& origin) {
    double six = 0;
    for (uint32_t t = 0; t < tree.triangle_count(); ++t) {
        std::array<Point, 3> p;
        for (size_t k = 0; k < 3; ++k) {
            const Vec3 v = tree.vertex(tree.triangle(t)[k]);
            p[k] = Point{v.x, v.y, v.z} - origin;
        }
        six += dot(p[0], cross(p[1], p[2]));
    }
    return six / 6;
}

class Folder : public ::testing::Test {
protected:
    void SetUp() override {
        std::string name = (fs::temp_directory_path() / "prolate-cases-XXXXXX").string();
        ASSERT_NE(::mkdtemp(name.data()), nullptr);
        folder_ = name;
    }
    void TearDown() override { fs::remove_all(folder_); }

    // The tree that the command bakes, and proves.
    std::optional<Tree> bake(const Case& c, const std::string& options) const {
        const std::string mesh = (folder_ / c.file).string(), tree = (folder_ / "out.etree").string();
        std::ofstream(mesh, std::ios::binary) << c.content;
        const auto command = [&](const std::string& words) {
            const int status = std::system((std::string(PROLATE_COMMAND) + words + " >" + tree + ".log 2>&1").c_str());
            std::ostringstream log;
            log << std::ifstream(tree + ".log").rdbuf();
            EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << words << '\n' << log.str();
            return status == 0;
        };
        if (!command(" bake " + mesh + " -o " + tree + options) || !command(" verify " + tree + " " + mesh)) return {};
        auto loaded = load(tree.c_str());
        if (!loaded) return {};
        return std::move(*loaded);
    }

private:
    fs::path folder_;
};

class Cases : public Folder, public ::testing::WithParamInterface<Case> {};

TEST_P(Cases, EachLevelCoversTheSolidOfTheFile) {
    const Case& c = GetParam();
    const auto tree = bake(c, " --levels 1 --quality fast");
    ASSERT_TRUE(tree);
    const Samples at = samples(c);
    for (uint32_t l = 0; l < tree->view().level_count(); ++l) {
        EXPECT_EQ(uncovered(tree->view(), l, at.surface, c.within * c.solid.size()), 0) << "level " << l;
        EXPECT_EQ(uncovered(tree->view(), l, at.inside, 0), 0) << "level " << l;
    }
}

TEST_P(Cases, AnExactTreeIsTheSolidOfTheFile) {
    const Case& c = GetParam();
    const auto tree = bake(c, " --exact");
    ASSERT_TRUE(tree);
    const Samples at = samples(c);
    const double within = c.within * c.solid.size();
    EXPECT_EQ(apart(tree->view(), at.surface, within), 0);
    EXPECT_EQ(apart(tree->view(), at.inside, 1e-3 * within), 0);
    EXPECT_EQ(apart(tree->view(), at.outside, 1e-3 * within), static_cast<ptrdiff_t>(at.outside.size()));
    if (c.closed) {
        const double right = std::abs(c.solid.volume());
        EXPECT_NEAR(std::abs(volume(tree->view(), c.solid.points[0])), right, 10 * c.within * right);
    }
}

TEST_F(Folder, TheChecksNoticeAnotherSolid) {
    Case c = as_obj("ball.obj", ball());
    const auto proxy = bake(c, " --levels 1 --quality fast"), exact = bake(c, " --exact");
    ASSERT_TRUE(proxy && exact);
    c.solid = moved(ball(), {0.2, 0, 0}, 1.1);
    const Samples at = samples(c);
    EXPECT_GT(uncovered(proxy->view(), 0, at.surface, 1e-6), 10);
    EXPECT_GT(uncovered(proxy->view(), proxy->view().level_count() - 1, at.inside, 0), 5);
    EXPECT_GT(apart(exact->view(), at.surface, 1e-6), 100);
    EXPECT_GT(apart(exact->view(), at.inside, 1e-9), 5);
    EXPECT_LT(apart(exact->view(), at.outside, 1e-9), static_cast<ptrdiff_t>(at.outside.size()));
    EXPECT_GT(std::abs(c.solid.volume()), 1.3 * volume(exact->view(), {}));
}

INSTANTIATE_TEST_SUITE_P(All, Cases, ::testing::ValuesIn(cases()), [](const auto& test) {
    std::string name = test.param.file;
    std::replace(name.begin(), name.end(), '.', '_');
    return name;
});

} // namespace
} // namespace prolate
