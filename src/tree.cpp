// Reading an .etree file in place: what TreeView::open has checked (open.cpp), decoded on demand.
#include <prolate/tree.hpp>

#include "src/bytes.hpp"
#include "src/format.hpp"
#include "src/layout.hpp"
#include "src/power_of_two.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>

namespace prolate {
namespace {

// The lane of a block that a slot is.
struct Place {
    const std::byte* block;
    size_t lane;
};
Place place_of(const TreeView& tree, uint32_t slot) {
    assert(slot < tree.slot_count());
    return {tree.raw().block(slot / kBlockLanes), slot % kBlockLanes};
}

} // namespace

Result<TreeView> TreeView::scaled(float scale) const noexcept {
    const auto size = [](const Ellipsoid& e) { // bounds all coordinates
        double sum = 0;
        for (const float x : {e.center.x, e.center.y, e.center.z, e.l11, e.l21, e.l22, e.l31, e.l32, e.l33})
            sum += std::abs(double{x});
        return sum;
    };
    const double step = power_of_two(raw_.lattice_.step_exponent) * scale;
    if (!(scale > 0 && step >= power_of_two(format::kMinStepExponent) &&
          step <= power_of_two(format::kMaxStepExponent) &&
          std::max(size(root_), size(root_bound_)) * scale <= double{kLargestCoordinate}))
        return Error{ErrorCode::bad_options, "a scale must be above 0, and keep the tree in the format's range", 0};
    TreeView out = *this;
    out.raw_.lattice_.scale = scale;
    return out;
}

Result<TreeView> TreeView::rounded(float radius) const noexcept {
    if (!(radius >= 0 && radius <= kLargestCoordinate))
        return Error{ErrorCode::bad_options, "a radius must be finite and not negative", 0};
    TreeView out = *this;
    out.radius_ = radius;
    return out;
}

Result<Tree> Tree::rounded(float radius) && {
    const auto view = view_.rounded(radius);
    if (!view) return view.error();
    return Tree(std::move(bytes_), *view);
}

TreeView TreeView::coarser(uint32_t last) const noexcept {
    if (last >= level_count_ - 1) return *this;
    TreeView out = *this;
    out.bytes_ = bytes_.first(static_cast<size_t>(level(last).end_byte));
    out.is_prefix_ = true;
    out.inner_ = out.modes_ = out.skin_ = {}, out.section_count_ = 0;
    out.raw_.hulls_ = out.raw_.vertices_ = out.raw_.triangles_ = nullptr;
    out.raw_.has_slabs_ = false;
    out.vertex_count_ = out.triangle_count_ = out.component_count_ = 0;
    out.count_levels(last + 1);
    out.find_root();
    return out;
}

namespace {

// A bound on the longest radius of the ellipsoid of which the squared lengths of the factor's rows add up to `trace`.
// With M = L L^T / trace, it is the root of trace times the largest eigenvalue of M, which is no larger than the eighth
// root of the Frobenius norm of M^8, and at least 0.93 of that.
double longest_radius(const Ellipsoid& e, double trace) {
    const double l[3][3] = {{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}};
    std::array<double, 6> m; // xx, xy, yy, xz, yz, zz
    for (size_t i = 0, at = 0; i < 3; ++i)
        for (size_t j = 0; j <= i; ++j) m[at++] = (l[i][0] * l[j][0] + l[i][1] * l[j][1] + l[i][2] * l[j][2]) / trace;
    for (int power = 1; power < 8; power *= 2) {
        const auto [xx, xy, yy, xz, yz, zz] = m;
        m = {xx * xx + xy * xy + xz * xz, xx * xy + xy * yy + xz * yz, xy * xy + yy * yy + yz * yz,
             xx * xz + xy * yz + xz * zz, xy * xz + yy * yz + yz * zz, xz * xz + yz * yz + zz * zz};
    }
    const auto [xx, xy, yy, xz, yz, zz] = m;
    const double norm = std::sqrt(xx * xx + yy * yy + zz * zz + 2 * (xy * xy + xz * xz + yz * yz));
    return std::sqrt(trace * std::sqrt(std::sqrt(std::sqrt(norm))));
}

detail::RootVolume volume_of(const Ellipsoid& e) {
    detail::RootVolume out;
    const double center[3] = {e.center.x, e.center.y, e.center.z};
    const double square[3] = {double{e.l11} * e.l11, double{e.l21} * e.l21 + double{e.l22} * e.l22,
                              double{e.l31} * e.l31 + double{e.l32} * e.l32 + double{e.l33} * e.l33};
    for (size_t i = 0; i < 3; ++i) out.center[i] = center[i], out.half[i] = std::sqrt(square[i]);
    out.radius = longest_radius(e, square[0] + square[1] + square[2]);
    return out;
}

detail::RootVolume volume_of_vertices(const TreeView& tree) {
    double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    const auto for_each = [&tree](auto&& visit) {
        for (uint32_t v = 0; v < tree.vertex_count(); ++v) {
            const Vec3 p = tree.vertex(v);
            const double at[3] = {p.x, p.y, p.z};
            visit(at);
        }
    };
    for_each([&](const double(&p)[3]) {
        for (size_t i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
    });
    detail::RootVolume out;
    for (size_t i = 0; i < 3; ++i) out.center[i] = 0.5 * (low[i] + high[i]), out.half[i] = 0.5 * (high[i] - low[i]);
    double farthest = 0;
    for_each([&](const double(&p)[3]) {
        double square = 0;
        for (size_t i = 0; i < 3; ++i) square += (p[i] - out.center[i]) * (p[i] - out.center[i]);
        farthest = std::max(farthest, square);
    });
    out.radius = std::sqrt(farthest);
    return out;
}

} // namespace

// What is known of the root at once. Takes the vertices, if there are any, to be checked.
void TreeView::find_root() noexcept {
    root_ = ellipsoid(0), root_bound_ = bound(0);
    detail::RootVolume& root = raw_.root_;
    root = has_triangles() ? volume_of_vertices(*this) : volume_of(root_bound_);
    const auto& c = root.center;
    root.reach = std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) + root.radius;
}

// With the first `count` levels.
void TreeView::count_levels(uint32_t count) noexcept {
    level_count_ = count;
    node_count_ = block_count_ = 0;
    for (uint32_t l = 0; l < count; ++l) node_count_ += level(l).node_count, block_count_ += level(l).block_count;
    if (raw_.bounding_blocks_ != nullptr) raw_.bounding_count_ = first_slot(count - 1) / kBlockLanes;
}

// What open() makes of the bytes of a whole tree without triangles and sections, which it has checked before.
TreeView TreeView::of_checked(std::span<const std::byte> bytes) noexcept {
    const std::byte* const h = bytes.data();
    const uint32_t levels = load_le<uint16_t>(h + kAtLevelCount);
    TreeView out;
    out.bytes_ = bytes;
    out.raw_.bounding_blocks_ = h + bounding_begin(levels);
    out.raw_.lattice_ = lattice_of(h);
    const auto bounding = load_le<uint32_t>(h + kHeaderBytes + (levels - 1) * kLevelBytes + kLevelFirstBlock);
    out.raw_.blocks_ = h + static_cast<size_t>(end_of_blocks(levels, bounding));
    out.count_levels(levels);
    out.find_root();
    return out;
}

std::optional<TreeView> TreeView::inner() const noexcept {
    if (inner_.empty()) return std::nullopt;
    TreeView out = of_checked(inner_);
    out.raw_.lattice_.scale = raw_.lattice_.scale;
    out.radius_ = radius_;
    return out;
}

std::optional<Deformation> TreeView::deformation() const noexcept {
    if (modes_.empty()) return std::nullopt;
    return Deformation(modes_, slot_count(), has_triangles());
}

std::optional<Skin> TreeView::skin() const noexcept {
    if (skin_.empty()) return std::nullopt;
    return Skin(skin_, slot_count(), has_triangles());
}

uint16_t TreeView::format_version() const noexcept {
    return load_le<uint16_t>(bytes_.data() + kAtVersion);
}

Section TreeView::section(uint32_t s) const noexcept {
    assert(s < section_count_);
    size_t at = sections_;
    const auto end_of = [this](size_t from) {
        return from + kSectionContent + static_cast<size_t>(load_le<uint64_t>(bytes_.data() + from + kSectionSize));
    };
    for (; s > 0; --s) at = static_cast<size_t>(section_aligned(end_of(at)));
    Section out;
    std::memcpy(out.kind, bytes_.data() + at + kSectionKind, sizeof out.kind);
    out.content = bytes_.subspan(at + kSectionContent, end_of(at) - (at + kSectionContent));
    return out;
}

uint32_t TreeView::degree() const noexcept {
    return load_le<uint16_t>(bytes_.data() + kAtDegree);
}

uint32_t TreeView::first_slot(uint32_t l) const noexcept {
    assert(l < level_count_);
    return kBlockLanes * load_le<uint32_t>(bytes_.data() + kHeaderBytes + l * kLevelBytes + kLevelFirstBlock);
}

uint32_t TreeView::level_of(uint32_t slot) const noexcept {
    assert(slot < slot_count());
    const std::byte* row = bytes_.data() + kHeaderBytes + kLevelFirstBlock;
    uint32_t level = 0;
    while (level + 1 < level_count_ && slot / kBlockLanes >= load_le<uint32_t>(row += kLevelBytes)) ++level;
    return level;
}

bool TreeView::surface_mode() const noexcept {
    return (load_le<uint32_t>(bytes_.data() + kAtFlags) & kSurfaceMode) != 0;
}

bool TreeView::is_exact() const noexcept {
    return (load_le<uint32_t>(bytes_.data() + kAtFlags) & kExact) != 0;
}

LevelInfo TreeView::level(uint32_t l) const noexcept {
    assert(l < level_count_);
    const std::byte* const row = bytes_.data() + kHeaderBytes + l * kLevelBytes;
    LevelInfo level;
    level.first_slot = first_slot(l);
    level.node_count = load_le<uint32_t>(row + kLevelNodeCount);
    level.end_byte = load_le<uint64_t>(row + kLevelEndByte);
    // As numbers, since open() asks for levels that a prefix does not hold.
    const uint64_t begin =
        static_cast<uint64_t>(raw_.blocks_ - bytes_.data()) + uint64_t{level.first_slot / kBlockLanes} * kBlockBytes;
    level.block_count = static_cast<uint32_t>((level.end_byte - begin) / kBlockBytes);
    level.union_volume = load_le<double>(row + kLevelUnionVolume);
    for (size_t i = 0; i < std::size(kFigures); ++i)
        level.*kFigures[i] = load_le<float>(row + kLevelFigures + sizeof(float) * i);
    return level;
}

BakeInfo TreeView::bake_info() const noexcept {
    const std::byte* const h = bytes_.data();
    Placement placement;
    for (size_t i = 0; i < 3; ++i) {
        placement.scale[i] = load_le<double>(h + kAtScale + 8 * i);
        placement.origin[i] = load_le<double>(h + kAtMeshOrigin + 8 * i);
    }
    std::array<double, kMassNumbers> mass;
    for (size_t i = 0; i < kMassNumbers; ++i) mass[i] = load_le<double>(h + kAtMass + sizeof(double) * i);
    return {.source_hash = load_le<uint64_t>(h + kAtSourceHash),
            .options_hash = load_le<uint64_t>(h + kAtOptionsHash),
            .surface_mode = surface_mode(),
            .exact = is_exact(),
            .proved = (load_le<uint32_t>(h + kAtFlags) & kProved) != 0,
            .goal_reached = (load_le<uint32_t>(h + kAtFlags) & kGoalMissed) == 0,
            .inner = (load_le<uint32_t>(h + kAtFlags) & kInner) != 0,
            .solid_volume = load_le<double>(h + kAtSolidVolume),
            .solid_volume_error = load_le<float>(h + kAtSolidVolumeError),
            .mass = std::bit_cast<MassProperties>(mass),
            .diagonal = load_le<double>(h + kAtDiagonal),
            .method = static_cast<Method>(load_le<uint8_t>(h + kAtMethod)),
            .primitive = static_cast<Primitive>(load_le<uint8_t>(h + kAtPrimitive)),
            .quality = static_cast<Quality>(load_le<uint8_t>(h + kAtQuality)),
            .alpha = load_le<float>(h + kAtAlpha),
            .beta = load_le<float>(h + kAtBeta),
            .tolerance = load_le<float>(h + kAtTolerance),
            .distance = load_le<float>(h + kAtDistance),
            .levels = load_le<uint32_t>(h + kAtLevels),
            .ellipsoids = load_le<uint32_t>(h + kAtEllipsoids),
            .seed = load_le<uint64_t>(h + kAtSeed),
            .resolution = load_le<uint32_t>(h + kAtResolution),
            .placement = placement,
            .weld = load_le<float>(h + kAtWeld),
            .fill = std::max(0.0f, load_le<float>(h + kAtBall)),
            .keep_holes = std::max(0.0f, -load_le<float>(h + kAtBall))};
}

bool TreeView::is_node(uint32_t slot) const noexcept {
    const auto [from, lane] = place_of(*this, slot);
    return load_le<uint16_t>(from + block_offset(kBlockDiagonal, 0, lane)) != 0;
}

namespace {

// As format::decode() does, in fewer steps.
Ellipsoid ellipsoid_at(const std::byte* from, size_t lane, const LatticeInfo& lattice) {
    const LaneNode e = load_node(from, static_cast<uint32_t>(lane), 0); // in metres, but for the center
    const auto unit = static_cast<float>(power_of_two(lattice.step_exponent) / kCenterUnits);
    const auto coordinate = [&](size_t i) { // of no more bits than a float has
        return static_cast<float>(lattice.origin[i] * kCenterUnits + stored_center(from, i, lane)) * unit;
    };
    return {.center = {coordinate(0), coordinate(1), coordinate(2)},
            .l11 = e.l11,
            .l21 = e.l21,
            .l22 = e.l22,
            .l31 = e.l31,
            .l32 = e.l32,
            .l33 = e.l33};
}

} // namespace

Ellipsoid TreeView::ellipsoid(uint32_t node) const noexcept {
    assert(is_node(node));
    const auto [from, lane] = place_of(*this, node);
    return ellipsoid_at(from, lane, raw_.lattice_);
}

Ellipsoid TreeView::bound(uint32_t node) const noexcept {
    assert(is_node(node));
    return ellipsoid_at(raw_.bounding_block(node / kBlockLanes), node % kBlockLanes, raw_.lattice_);
}

ChildRange TreeView::children(uint32_t node) const noexcept {
    assert(is_node(node));
    const auto [from, lane] = place_of(*this, node);
    const uint32_t count = load_le<uint8_t>(from + kBlockCount + lane), first = first_child(from, lane);
    return count > 0 && count < kTriangleLeaf && first < slot_count() ? ChildRange{first, count} : ChildRange{};
}

TriangleRange TreeView::triangles(uint32_t node) const noexcept {
    assert(is_node(node));
    const auto [from, lane] = place_of(*this, node);
    const auto count = load_le<uint8_t>(from + kBlockCount + lane);
    if (!has_triangles() || count < kTriangleLeaf) return {};
    return {first_triangle(from, lane), uint32_t{count} - kTriangleLeaf};
}

Triangle TreeView::triangle(uint32_t t) const noexcept {
    assert(t < triangle_count_);
    if (index_bytes(vertex_count_) == 2) {
        const std::byte* const from = raw_.triangles_ + size_t{t} * 6;
        return {load_le<uint16_t>(from), load_le<uint16_t>(from + 2), load_le<uint16_t>(from + 4)};
    }
    const std::byte* const from = raw_.triangles_ + size_t{t} * 12;
    return {load_le<uint32_t>(from), load_le<uint32_t>(from + 4), load_le<uint32_t>(from + 8)};
}

Vec3 TreeView::vertex(uint32_t v) const noexcept {
    assert(v < vertex_count_);
    const std::byte* const from = raw_.vertices_ + size_t{v} * kVertexBytes;
    return {load_le<float>(from), load_le<float>(from + 4), load_le<float>(from + 8)};
}

} // namespace prolate
