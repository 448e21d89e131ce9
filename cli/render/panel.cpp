// Each pixel is sampled on a jittered grid. A tile first traces the primary rays of its pixels and of a border around
// them, so that each sample can see whether its neighbours hit something else (an outline), then shades its samples.
// What is seen through another scene is a second layer of the same kind.
// All random numbers are hashes of the pixel and the sample, so tiles can be rendered in any order, on any thread.
//
// Light: a key light of finite size from above the viewer's left shoulder, and a white sky dimmed by ambient
// occlusion; one shadow ray and one sky ray a sample, stratified over the samples of a pixel. Sections are flat: they
// get no light, so that their colours are true. What is cut away throws no shadow.
//
// Cost: about three rays for each of width * height * grid^2 samples that see the scene, two where the floor may be in
// shadow, one elsewhere; paint once a pixel, or where it shows several parts, a few times.
#include "cli/render/panel.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <mutex>
#include <numbers>

#include <tbb/parallel_for.h>

namespace prolate::cli {
namespace {

using glm::dvec2;
using glm::dvec3;

constexpr uint32_t kTile = 32;         // pixels
constexpr double kCrease = 0.02;       // a gap in depth that is drawn as an outline within one shape
constexpr double kOutlineShade = 0.32; // what is left of the colour on an outline
constexpr double kFloorReach = 1.7;    // radius around the scene in which the floor shadow fades out
constexpr double kFloorDarkness = 0.42;
constexpr double kGlass = 0.42; // opacity of a surface that lets others be seen, where it faces the viewer

// A hash of three numbers; the mixer is the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
uint64_t mix(uint64_t x, uint64_t y, uint64_t salt) {
    uint64_t h = (x << 32 | y) + salt * 0x9E3779B97F4A7C15u;
    h = (h ^ (h >> 30)) * 0xBF58476D1CE4E5B9u;
    h = (h ^ (h >> 27)) * 0x94D049BB133111EBu;
    return h ^ (h >> 31);
}

dvec2 unit_pair(uint64_t hash) {
    constexpr double kScale = 1.0 / 4294967296.0;
    return {static_cast<double>(hash >> 32) * kScale, static_cast<double>(hash & 0xFFFFFFFFu) * kScale};
}

// Point i of the R2 sequence (M. Roberts 2018), shifted: low-discrepancy over the samples of a pixel.
dvec2 spread(uint32_t i, const dvec2& shift) {
    const dvec2 p = shift + static_cast<double>(i) * dvec2(0.7548776662466927, 0.5698402909980532);
    return p - glm::floor(p);
}

// A direction around the unit vector `axis`, cosine-weighted, within the cone whose angle has the sine `reach`.
dvec3 cone_direction(const dvec3& axis, const dvec2& p, double reach) {
    const dvec3 side = std::abs(axis.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0);
    const dvec3 a = glm::normalize(glm::cross(axis, side)), b = glm::cross(axis, a);
    const double r = reach * std::sqrt(p.x), phi = 2 * std::numbers::pi * p.y;
    return r * std::cos(phi) * a + r * std::sin(phi) * b + std::sqrt(std::max(0.0, 1 - r * r)) * axis;
}

double smooth_step(double from, double to, double x) {
    const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

double to_32nd(double x) {
    for (int i = 0; i < 5; ++i) x *= x;
    return x;
}

// One layer of a panel: what all of its samples share.
class Painter {
public:
    // `inset`, if there is one, is drawn in sections.
    Painter(const Scene& scene, const PanelContent& content, const Scene* inset, const PanelSettings& s)
        : scene_(scene), inset_(inset), content_(content), s_(s), bounds_(scene.window(s.camera)),
          floor_(-scene.extent(-s.up)) {
        if (inset) bounds_.add(inset->window(s.camera));
        // Wider than the rounding of a triangle's corner to float.
        bounds_ = {bounds_.u0 - 1e-5, bounds_.u1 + 1e-5, bounds_.v0 - 1e-5, bounds_.v1 + 1e-5};
        const Camera& c = s.camera;
        const dvec3 back = glm::normalize(dvec3(-c.forward - glm::dot(-c.forward, s.up) * s.up));
        key_ = glm::normalize(-0.55 * c.right + 0.95 * s.up + 0.6 * back);
        // The scene's bounding box along two directions in the floor says where it stands and how far it reaches.
        foot_ = floor_ * s.up;
        for (const dvec3& axis : {c.right, glm::cross(c.right, s.up)}) {
            const double high = scene.extent(axis), low = -scene.extent(-axis);
            foot_ += (low + high) / 2 * axis;
            foot_radius_ = std::max(foot_radius_, (high - low) / 2);
        }
        drawn_ = bounds_;
        const dvec3 reach = kFloorReach * foot_radius_ * c.right, across = glm::cross(s.up, reach);
        if (s.floor_shadow)
            for (const dvec3& corner : {reach + across, reach - across, -reach + across, -reach - across}) {
                const dvec3 d = foot_ + corner - c.eye;
                const double u = glm::dot(d, c.right) / glm::dot(d, c.forward);
                const double v = glm::dot(d, c.up) / glm::dot(d, c.forward);
                drawn_.add({u, u, v, v});
            }
    }

    // Direction of the ray through sample (x, y) of the supersampled image; samples outside of the image are fine.
    dvec3 ray(int x, int y) const {
        const dvec2 p = slopes(x, y);
        return glm::normalize(s_.camera.direction(p.x, p.y));
    }

    // The last points of a section whose places were asked for.
    struct Known {
        struct Point {
            dvec3 at{0};
            Place place;
        };
        Point scene, inset;
    };

    Hit hit(int x, int y, Known& known) const {
        const dvec2 p = slopes(x, y);
        if (p.x < bounds_.u0 || p.x > bounds_.u1 || p.y < bounds_.v0 || p.y > bounds_.v1) return {};
        const dvec3 &eye = s_.camera.eye, direction = glm::normalize(s_.camera.direction(p.x, p.y));
        const Reach reach = kept(eye, direction);
        if (reach.empty()) return {};
        if (reach.from > 0) {
            const dvec3 at = eye + reach.from * direction;
            uint32_t id = inset_ ? id_at(at, *inset_, known.inset) : kNothing;
            if (id == kNothing) id = id_at(at, scene_, known.scene);
            if (id != kNothing) return {reach.from, id, true, s_.section->normal};
        }
        return scene_.first_hit(eye, direction, reach);
    }

    dvec3 point(const Hit& hit, const dvec3& direction) const { return s_.camera.eye + hit.distance * direction; }
    dvec3 paint(const Hit& hit, const dvec3& at) const { return content_.paint(hit, at); }

    // Whether these pixels show neither the scene nor its shadow.
    bool is_blank(uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1) const {
        const double u0 = slope_u(x0 * s_.grid), u1 = slope_u(x1 * s_.grid);
        const double v0 = slope_v(y1 * s_.grid), v1 = slope_v(y0 * s_.grid);
        return u1 < drawn_.u0 || u0 > drawn_.u1 || v1 < drawn_.v0 || v0 > drawn_.v1;
    }

    // What light makes of `colour` at a hit.
    dvec3 lit(const dvec3& colour, const Hit& hit, const dvec3& direction, uint32_t sample, const dvec2& shift) const {
        if (hit.in_section) return colour;
        const dvec3& n = hit.normal;
        // Off the surface by more than the rounding of the hit distance.
        const dvec3 p = point(hit, direction) + 1e-5 * n;
        const dvec2 random = spread(sample, shift);
        const dvec3 to_key = cone_direction(key_, random, 0.12);
        const double facing = glm::dot(n, to_key);
        const double key = facing > 0 && !blocked(p, to_key) ? facing : 0;
        // The other order of coordinates: the sky ray must not follow the key ray.
        const dvec3 to_sky = cone_direction(n, {random.y, random.x}, 1);
        const double sky_here = 0.8 + 0.2 * glm::dot(to_sky, s_.up);
        const double sky = blocked(p, to_sky) ? 0.12 : sky_here;
        const dvec3 half = glm::normalize(to_key - direction);
        const double gloss = key > 0 ? 0.10 * to_32nd(std::max(0.0, glm::dot(n, half))) : 0;
        return colour * (1 + content_.relief * (0.60 * sky + 0.62 * key - 1)) + content_.relief * gloss;
    }

    // White paper, darker where the scene hides the sky over the floor.
    dvec3 paper(const dvec3& direction, uint32_t sample, const dvec2& shift) const {
        const double fall = glm::dot(direction, s_.up);
        if (!s_.floor_shadow || fall > -1e-3) return dvec3(1);
        const double t = (floor_ - glm::dot(s_.camera.eye, s_.up)) / fall;
        if (t <= 0) return dvec3(1); // the eye is below the floor
        const dvec3 p = s_.camera.eye + t * direction;
        const double fade = (1 - smooth_step(0.5, 1, glm::length(p - foot_) / (kFloorReach * foot_radius_))) *
                            smooth_step(0, 0.15, distance_to_border(direction));
        if (fade <= 0) return dvec3(1);
        const dvec3 to_light = cone_direction(glm::normalize(0.45 * key_ + s_.up), spread(sample, shift), 0.75);
        return dvec3(blocked(p + 1e-5 * s_.up, to_light) ? 1 - kFloorDarkness * fade : 1.0);
    }

    // What is left of a colour on an outline.
    double ink() const { return 1 - content_.relief * (1 - kOutlineShade); }

private:
    // Most samples are nearer to the last one than any surface: then they are where it is.
    static uint32_t id_at(const dvec3& at, const Scene& scene, Known::Point& last) {
        if (!(glm::distance(at, last.at) < 0.999 * last.place.clear)) last = {at, scene.place_of(at)};
        return last.place.id;
    }
    Reach kept(const dvec3& origin, const dvec3& direction) const {
        return s_.section ? s_.section->clip(origin, direction) : Reach{};
    }
    bool blocked(const dvec3& origin, const dvec3& direction) const {
        const Reach reach = kept(origin, direction);
        return !reach.empty() && scene_.blocked(origin, direction, reach);
    }
    // Of the point where the ray meets the image, as a part of the image's width or height; the floor shadow must not
    // be cut off at the border.
    double distance_to_border(const dvec3& direction) const {
        const Camera& c = s_.camera;
        const Window& w = s_.window;
        const double depth = glm::dot(direction, c.forward);
        const double u = (glm::dot(direction, c.right) / depth - w.u0) / (w.u1 - w.u0);
        const double v = (glm::dot(direction, c.up) / depth - w.v0) / (w.v1 - w.v0);
        return std::min({u, 1 - u, v, 1 - v});
    }
    double slope_u(double x) const { return s_.window.u0 + x / (s_.width * s_.grid) * (s_.window.u1 - s_.window.u0); }
    double slope_v(double y) const { return s_.window.v1 - y / (s_.height * s_.grid) * (s_.window.v1 - s_.window.v0); }
    dvec2 slopes(int x, int y) const {
        const dvec2 jitter = unit_pair(mix(static_cast<uint32_t>(x), static_cast<uint32_t>(y), 1));
        return {slope_u(x + jitter.x), slope_v(y + jitter.y)};
    }

    const Scene& scene_;
    const Scene* inset_;
    const PanelContent& content_;
    const PanelSettings& s_;
    Window bounds_; // of all that is drawn; no ray beyond meets it
    Window drawn_;  // of the scene and its shadow
    double floor_;
    dvec3 key_, foot_;
    double foot_radius_ = 0;
};

// The hits of a tile and of a border of whole pixels around it.
class Tile {
public:
    Tile(const Painter& painter, const PanelSettings& s, int x0, int y0, int columns, int rows)
        : grid_(static_cast<int>(s.grid)), line_(std::max(1.0, s.line_width * s.grid)),
          border_(static_cast<int>(std::ceil(line_ / s.grid))), x0_((x0 - border_) * grid_),
          y0_((y0 - border_) * grid_), pixel_columns_(columns + 2 * border_), columns_(pixel_columns_ * grid_) {
        const int pixel_rows = rows + 2 * border_;
        hits_.resize(static_cast<size_t>(columns_) * pixel_rows * grid_);
        ranges_.resize(static_cast<size_t>(pixel_columns_) * pixel_rows);
        Painter::Known known;
        for (int y = 0; y < pixel_rows * grid_; ++y)
            for (int x = 0; x < columns_; ++x) {
                Hit& hit = hits_[static_cast<size_t>(y) * columns_ + x];
                hit = painter.hit(x0_ + x, y0_ + y, known);
                ranges_[static_cast<size_t>(y / grid_) * pixel_columns_ + x / grid_].add(hit);
            }
        for (int i = 0; i < kRing; ++i) {
            const double angle = 2 * std::numbers::pi * i / kRing;
            const auto dx = static_cast<int>(std::lround(line_ * std::cos(angle)));
            const auto dy = static_cast<int>(std::lround(line_ * std::sin(angle)));
            ring_[i] = static_cast<ptrdiff_t>(dy) * columns_ + dx;
        }
    }

    const Hit& hit(int x, int y) const { return hits_[index(x, y)]; }

    // Whether no sample of the pixel can be on an outline: everything near it is one shape without a crease.
    bool is_plain(int px, int py) const {
        Range all;
        const int cx = px - x0_ / grid_, cy = py - y0_ / grid_;
        for (int y = cy - border_; y <= cy + border_; ++y)
            for (int x = cx - border_; x <= cx + border_; ++x)
                all.add(ranges_[static_cast<size_t>(y) * pixel_columns_ + x]);
        return all.first == all.last && (all.first == Hit{}.part() || all.far <= all.near + kCrease);
    }

    // Whether a sample that hit something has a neighbour, at the distance of a line's width, that hit something
    // else. The line is drawn on the nearer of two shapes.
    bool is_outline(int x, int y) const {
        const size_t at = index(x, y);
        const Hit& mine = hits_[at];
        return std::any_of(ring_.begin(), ring_.end(), [&](ptrdiff_t offset) {
            const Hit& other = hits_[at + offset];
            if (other.id == kNothing) return true;
            if (other.part() != mine.part()) return other.distance >= mine.distance;
            return other.distance > mine.distance + kCrease && glm::dot(mine.normal, other.normal) < 0.9;
        });
    }

private:
    static constexpr int kRing = 12;
    // Parts and distances in one or more pixels.
    struct Range {
        uint64_t first = UINT64_MAX, last = 0;
        double near = std::numeric_limits<double>::infinity(), far = 0;
        void add(const Hit& hit) { add(Range{hit.part(), hit.part(), hit.distance, hit.distance}); }
        void add(const Range& r) {
            first = std::min(first, r.first);
            last = std::max(last, r.last);
            near = std::min(near, r.near);
            far = std::max(far, r.far);
        }
    };
    size_t index(int x, int y) const { return static_cast<size_t>(y - y0_) * columns_ + (x - x0_); }

    int grid_;
    double line_; // in samples
    int border_;  // in pixels
    int x0_, y0_, pixel_columns_, columns_;
    std::array<ptrdiff_t, kRing> ring_{};
    std::vector<Hit> hits_;
    std::vector<Range> ranges_;
};

// The samples of one layer in one tile.
class Layer {
public:
    Layer(const Painter& painter, const PanelSettings& s, uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1)
        : painter_(painter), tile_(painter, s, static_cast<int>(x0), static_cast<int>(y0), static_cast<int>(x1 - x0),
                                   static_cast<int>(y1 - y0)) {}

    void begin_pixel(uint32_t px, uint32_t py) {
        plain_ = tile_.is_plain(static_cast<int>(px), static_cast<int>(py));
        painted_ = Hit{}.part();
    }
    const Hit& hit(int x, int y) const { return tile_.hit(x, y); }
    // Of a sample that hit something.
    dvec3 colour(int x, int y, uint32_t sample, const dvec2& shift) {
        const Hit& hit = tile_.hit(x, y);
        const dvec3 direction = painter_.ray(x, y);
        if (hit.part() != painted_) {
            paint_ = painter_.paint(hit, painter_.point(hit, direction));
            painted_ = hit.part();
        }
        const double ink = !plain_ && tile_.is_outline(x, y) ? painter_.ink() : 1;
        return ink * painter_.lit(paint_, hit, direction, sample, shift);
    }

private:
    const Painter& painter_;
    Tile tile_;
    bool plain_ = false;
    uint64_t painted_ = 0; // the part that paint_ is of: paint varies too little within a pixel to be asked for again
    dvec3 paint_{0};
};

// How much of a surface's own colour is seen if it lets others through: more where it is seen edge-on, as in glass.
double opacity(const Hit& hit, const dvec3& direction) {
    if (hit.in_section) return 1;
    const double edge = 1 - std::abs(glm::dot(hit.normal, direction));
    return kGlass + (1 - kGlass) * edge * edge * edge;
}

// `behind` is null, or what is seen through `front`.
void render_tile(const Painter& front, const Painter* behind, const PanelSettings& s, uint32_t x0, uint32_t y0,
                 PanelImage& image) {
    const uint32_t x1 = std::min(x0 + kTile, s.width), y1 = std::min(y0 + kTile, s.height);
    if (front.is_blank(x0, y0, x1, y1) && (!behind || behind->is_blank(x0, y0, x1, y1))) return;
    Layer layer(front, s, x0, y0, x1, y1);
    std::optional<Layer> mesh;
    if (behind) mesh.emplace(*behind, s, x0, y0, x1, y1);
    for (uint32_t py = y0; py < y1; ++py)
        for (uint32_t px = x0; px < x1; ++px) {
            layer.begin_pixel(px, py);
            if (mesh) mesh->begin_pixel(px, py);
            const dvec2 shift = unit_pair(mix(px, py, 2));
            dvec3 sum(0);
            uint32_t covered = 0;
            for (uint32_t i = 0; i < s.grid * s.grid; ++i) {
                const auto x = static_cast<int>(px * s.grid + i % s.grid),
                           y = static_cast<int>(py * s.grid + i / s.grid);
                const Hit& hit = layer.hit(x, y);
                const double mesh_distance = mesh ? mesh->hit(x, y).distance : HUGE_VAL;
                const double seen = hit.id == kNothing || mesh_distance < hit.distance ? 0
                                    : mesh                                             ? opacity(hit, front.ray(x, y))
                                                                                       : 1;
                if (seen < 1)
                    sum += (1 - seen) * (mesh_distance < HUGE_VAL ? mesh->colour(x, y, i, shift)
                                                                  : front.paper(front.ray(x, y), i, shift));
                if (seen > 0) sum += seen * layer.colour(x, y, i, shift);
                covered += seen > 0 || mesh_distance < HUGE_VAL;
            }
            const double samples = s.grid * s.grid;
            const size_t pixel = static_cast<size_t>(py) * s.width + px;
            // In this order, what is not a number (from an ellipsoid thinner than double precision) becomes 0.
            image.colour[pixel] = glm::vec3(glm::min(dvec3(1), glm::max(dvec3(0), sum / samples)));
            image.coverage[pixel] = static_cast<float>(covered / samples);
        }
}

} // namespace

bool render_panel(const PanelContent& content, const PanelSettings& s, const std::function<bool(double)>& progress,
                  PanelImage& image) {
    image.width = s.width;
    image.height = s.height;
    image.colour.assign(static_cast<size_t>(s.width) * s.height, glm::vec3(1));
    image.coverage.assign(image.colour.size(), 0);
    const Painter front(*content.scene, content, content.mesh, s);
    std::optional<Painter> behind;
    if (content.mesh && content.see_through) behind.emplace(*content.mesh, content, nullptr, s);
    const uint32_t across = (s.width + kTile - 1) / kTile, down = (s.height + kTile - 1) / kTile;
    std::mutex reporting;
    uint32_t done = 0;
    std::atomic<bool> stopped = false;
    tbb::parallel_for(0u, across * down, [&](uint32_t tile) {
        if (stopped) return;
        render_tile(front, behind ? &*behind : nullptr, s, tile % across * kTile, tile / across * kTile, image);
        const std::scoped_lock lock(reporting);
        ++done;
        if (progress && !progress(static_cast<double>(done) / (across * down))) stopped = true;
    });
    return !stopped;
}

} // namespace prolate::cli
