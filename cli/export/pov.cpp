// pov: a scene for POV-Ray 3.7, with true ellipsoids.
//
// POV-Ray's own conventions are left-handed. The camera is given by its vectors, which may be any, so that the picture
// of right-handed coordinates is not mirrored. A matrix lists images of the axes, then the translation.
#include "cli/export/formats.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <limits>

namespace prolate::cli {
namespace {

using glm::dvec3;

constexpr double kAir = 1.08; // around the cover in the picture

// POV-Ray warns of a camera whose vectors are not perpendicular to ten digits.
std::string vector(const dvec3& v) {
    return fmt::format("<{:.14g}, {:.14g}, {:.14g}>", v.x, v.y, v.z);
}

// All digits: POV-Ray reads doubles, and the shortest digits that tell a float from others are not its value.
double exact(float x) {
    return x;
}

// How far the cover reaches along `n`: the largest n.p of its points.
double extent(std::span<const Piece> pieces, const dvec3& n) {
    double farthest = -std::numeric_limits<double>::infinity();
    for (const Piece& piece : pieces) {
        const Ellipsoid& e = piece.shape;
        const dvec3 turned(e.l11 * n.x + e.l21 * n.y + e.l31 * n.z, e.l22 * n.y + e.l32 * n.z, e.l33 * n.z);
        farthest = std::max(farthest, glm::dot(n, dvec3(e.center.x, e.center.y, e.center.z)) + glm::length(turned));
    }
    return farthest;
}

void add_cover(std::string& out, std::span<const Piece> pieces) {
    const auto to = std::back_inserter(out);
    out += "#declare Cover = union {\n";
    for (const Piece& piece : pieces) {
        const Ellipsoid& e = piece.shape;
        fmt::format_to(to,
                       "  sphere {{ 0, 1 matrix <{}, {}, {}, 0, {}, {}, 0, 0, {}, {}, {}, {}> "
                       "pigment {{ color rgb <{:.4f}, {:.4f}, {:.4f}> }} }} // node {}\n",
                       exact(e.l11), exact(e.l21), exact(e.l31), exact(e.l22), exact(e.l32), exact(e.l33),
                       exact(e.center.x), exact(e.center.y), exact(e.center.z), piece.colour.x, piece.colour.y,
                       piece.colour.z, piece.node);
    }
    out += "  finish { ambient 0.10 diffuse 0.72 specular 0.12 roughness 0.03 }\n}\n";
}

} // namespace

std::string as_pov(std::span<const Piece> pieces, const View& view) {
    dvec3 low, high;
    for (int i = 0; i < 3; ++i) {
        dvec3 axis(0);
        axis[i] = 1;
        high[i] = extent(pieces, axis), low[i] = -extent(pieces, -axis);
    }
    const dvec3 center = (low + high) / 2.0, up = up_vector(view.up);
    const double radius = glm::length(high - low) / 2;
    const Camera camera = make_camera(view);
    const double distance = glm::length(camera.eye), sine = kAir / distance;
    const dvec3 back = -camera.forward - glm::dot(-camera.forward, up) * up;
    const dvec3 to_light = glm::normalize(-0.6 * camera.right + 1.2 * up + 0.5 * glm::normalize(back));
    const dvec3 across = glm::normalize(glm::cross(to_light, up)), along = glm::cross(to_light, across);

    std::string out =
        "// prolate export. A picture: povray +I\"this file\" +W1200 +H900 +A0.1\n"
        "// For a scene of your own: #declare Only_Cover = true; #include it, and place object { Cover }.\n"
        "#version 3.7;\n\n";
    add_cover(out, pieces);
    const auto to = std::back_inserter(out);
    out += "\n#ifndef (Only_Cover)\nglobal_settings { assumed_gamma 1 }\nbackground { color rgb 1 }\n";
    fmt::format_to(to,
                   "camera {{\n  perspective\n  location {}\n  direction {}\n  up {}\n"
                   "  right {} * image_width / image_height\n}}\n",
                   vector(center + radius * camera.eye),
                   vector(0.5 * std::sqrt(1 - sine * sine) / sine * camera.forward), vector(camera.up),
                   vector(camera.right));
    fmt::format_to(
        to, "light_source {{\n  {} color rgb 0.85\n  area_light {}, {}, 9, 9 adaptive 1 jitter circular orient\n}}\n",
        vector(center + 30 * radius * to_light), vector(7 * radius * across), vector(7 * radius * along));
    fmt::format_to(to, "light_source {{ {} color rgb 0.35 shadowless }}\n", vector(center + radius * camera.eye));
    fmt::format_to(to, "plane {{ {}, {:.9g} pigment {{ color rgb 1 }} finish {{ ambient 0.3 diffuse 0.72 }} }}\n",
                   vector(up), -extent(pieces, -up));
    out += "object { Cover }\n#end\n";
    return out;
}

} // namespace prolate::cli
