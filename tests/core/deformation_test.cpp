// The section DFRM of a file: golden bytes, what they decode to, and every change of them.
//
// The expected numbers are the format's (src/FORMAT.md). If one of these tests fails because the layout changed, the
// format version must change too, and the old golden files stay.
#include "src/bytes.hpp"
#include "src/deformation.hpp"
#include "src/format.hpp"

#include <prolate/tree.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace prolate {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;

Bytes read(const char* name) {
    std::ifstream in(fs::path(PROLATE_TEST_DATA) / name, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(in)), {});
    const auto* const data = reinterpret_cast<const std::byte*>(text.data());
    return {data, data + text.size()};
}

// Both golden trees have six nodes, one block a level.
constexpr uint32_t kNodes[] = {0, 8, 9, 16, 17, 18}, kSlots = 24, kModes = 2, kVertices = 7;

// The section's content: whatever numbers there may be, and that tell one place from another.
Bytes content(bool exact) {
    Bytes out;
    const auto put = [&out](auto value) {
        out.resize(out.size() + sizeof value);
        store_le(out.data() + out.size() - sizeof value, value);
    };
    const uint32_t points = exact ? kVertices : 2;
    put(kModes), put(points), put(uint64_t{0});
    for (const float x : {0.5f, 0.125f, 0.0625f, 0.25f}) put(x); // range, steps of shifts, growths and radii
    for (const float x : {2.0f, 0.5f, 0.0f, 0.03125f}) put(x);   // it never grows
    for (uint32_t slot = 0, node = 0; slot < kSlots; ++slot) {
        const bool is_node = node < std::size(kNodes) && kNodes[node] == slot;
        node += is_node ? 1 : 0;
        for (uint32_t mode = 0; mode < kModes; ++mode) {
            const int n = is_node ? static_cast<int>(100 * slot + 10 * mode) : 0;
            put(static_cast<int16_t>(n)), put(static_cast<int16_t>(-2 * n)), put(static_cast<int16_t>(-n));
            const bool radius = is_node && (mode == 1 || slot % 2 == 1);
            put(static_cast<uint16_t>(radius ? 0x8000 | (slot + 1) : is_node ? 300 + slot : 0));
        }
    }
    if (!exact)
        for (uint32_t p = 0; p < points; ++p)
            for (int axis = 0; axis < 3; ++axis) put(static_cast<float>(p) + 0.25f * static_cast<float>(axis));
    for (uint32_t i = 0; i < points * kModes; ++i)
        for (int axis = 0; axis < 3; ++axis) put(static_cast<float>(i) - 0.5f * static_cast<float>(axis));
    return out;
}

struct Golden {
    const char *rest, *moving;
    bool exact;
    Bytes bytes() const {
        Bytes out = read(rest);
        format::append_section(out, kDeformationKind, content(exact));
        return out;
    }
};
constexpr Golden kGolden[] = {{"golden_v8.etree", "golden_v9_modes.etree", false},
                              {"golden_v8_exact.etree", "golden_v9_modes_exact.etree", true}};

// Everything that an accessor can answer is in range.
void expect_sound(const TreeView& tree) {
    const auto deformation = tree.deformation();
    ASSERT_TRUE(deformation);
    ASSERT_LE(deformation->mode_count(), kMaxModes);
    for (uint32_t m = 0; m < deformation->mode_count(); ++m) {
        ASSERT_TRUE(deformation->range(m) > 0 && std::isfinite(deformation->range(m)));
        tree.for_each_node([&](uint32_t node) {
            const Deformation::Motion motion = deformation->motion(node, m);
            for (const double x : motion.shift) ASSERT_TRUE(std::isfinite(x * double{deformation->range(m)}));
            ASSERT_TRUE(motion.growth >= 0 && motion.growth * deformation->range(m) <= 1536);
            ASSERT_TRUE(motion.radius >= 0 && std::isfinite(motion.radius * double{deformation->range(m)}));
        });
        for (uint32_t p = 0; p < deformation->point_count(); ++p)
            for (const float x : {deformation->displacement(p, m).x, deformation->displacement(p, m).z})
                ASSERT_TRUE(std::isfinite(x));
    }
}

// PROLATE_WRITE_GOLDEN=1 deformation_test writes the files anew, for a new version.
TEST(DeformationSection, GoldenFiles) {
    for (const Golden& golden : kGolden) {
        const Bytes now = golden.bytes();
        if (std::getenv("PROLATE_WRITE_GOLDEN") != nullptr) {
            EXPECT_TRUE(save((fs::path(PROLATE_TEST_DATA) / golden.moving).c_str(), now));
        }
        const Bytes file = read(golden.moving);
        EXPECT_EQ(file, now);
        const auto tree = TreeView::open(file);
        ASSERT_TRUE(tree) << tree.error().what;
        expect_sound(*tree);
        EXPECT_EQ(tree->format_version(), 9);
        ASSERT_EQ(tree->section_count(), 1u);
        EXPECT_EQ(std::memcmp(tree->section(0).kind, "DFRM", 4), 0);
        ASSERT_EQ(tree->slot_count(), kSlots);
        EXPECT_EQ(tree->section(0).content.size(), 16 + 32 + kSlots * 16 + (golden.exact ? 7 * 24 : 2 * 36));
        const Deformation modes = *tree->deformation();
        EXPECT_EQ(modes.mode_count(), 2u);
        EXPECT_EQ(modes.range(0), 0.5f);
        EXPECT_EQ(modes.range(1), 2);
        const Deformation::Motion grows = modes.motion(18, 0), is_within = modes.motion(9, 1);
        EXPECT_EQ(grows.shift[0], 1800 * 0.125);
        EXPECT_EQ(grows.shift[1], -3600 * 0.125);
        EXPECT_EQ(grows.shift[2], -1800 * 0.125);
        EXPECT_EQ(grows.growth, 318 * 0.0625);
        EXPECT_EQ(grows.radius, 0);
        EXPECT_EQ(is_within.shift[0], 910 * 0.5);
        EXPECT_EQ(is_within.growth, 0);
        EXPECT_EQ(is_within.radius, 10 * 0.03125);
        EXPECT_EQ(modes.motion(17, 0).radius, 18 * 0.25);
        ASSERT_EQ(modes.point_count(), golden.exact ? kVertices : 2);
        const float q[] = {-0.25f, 2};
        const Deformation::Moved node = modes.moved(9, q), odd = modes.moved(16, q), point = modes.displaced(1, q);
        EXPECT_EQ(node.shift[0], -0.25 * 112.5 + 2 * 455);
        EXPECT_EQ(node.lengths[1], 0.25 * 225 + 2 * 910);
        EXPECT_EQ(node.growth, 0);
        EXPECT_EQ(node.radius, 0.25 * (10 * 0.25) + 2 * (10 * 0.03125));
        EXPECT_EQ(odd.growth, 0.25 * (316 * 0.0625));
        EXPECT_EQ(odd.radius, 2 * (17 * 0.03125));
        EXPECT_EQ(point.shift[1], -0.25 * 1.5 + 2 * 2.5);
        EXPECT_EQ(point.lengths[2], 0.25 * 1 + 2 * 2);
        EXPECT_EQ(modes.displacement(1, 0), (Vec3{2, 1.5f, 1}));
        EXPECT_EQ(modes.displacement(1, 1), (Vec3{3, 2.5f, 2}));
        if (!golden.exact) {
            EXPECT_EQ(modes.point(1), (Vec3{1, 1.25f, 1.5f}));
        }
        // The tree itself is as in a file without sections, and a coarser one does not deform.
        EXPECT_EQ(tree->root_bound(), TreeView::open(read(golden.rest))->root_bound());
        EXPECT_FALSE(tree->coarser(1).deformation());
    }
}

TEST(DeformationSection, EveryChangeIsFoundAndWithoutHashesRefusedOrSound) {
    for (const Golden& golden : kGolden) {
        Bytes bytes = golden.bytes();
        const size_t begin = read(golden.rest).size();
        uint32_t accepted = 0, refused = 0;
        for (size_t at = begin; at < bytes.size(); ++at)
            for (const unsigned flip : {1u, 2u, 0x40u, 0x7fu, 0x80u, 0xffu}) {
                bytes[at] ^= std::byte(flip);
                ASSERT_FALSE(TreeView::open(bytes)) << "byte " << at << " xor " << flip;
                const auto tree = TreeView::open(bytes, {.check_hash = false});
                ++(tree ? accepted : refused);
                if (tree && tree->deformation()) expect_sound(*tree); // not if the kind has changed
                if (HasFatalFailure()) FAIL() << "byte " << at << " xor " << flip;
                bytes[at] ^= std::byte(flip);
            }
        EXPECT_GT(accepted, 500u);
        EXPECT_GT(refused, 500u);
    }
}

TEST(DeformationSection, OffencesAreNamed) {
    struct Case {
        bool exact;
        size_t at; // in the content
        std::vector<int> bytes;
        size_t where;
    };
    const size_t motions = 16 + 2 * 16, points = motions + kSlots * 2 * 8;
    const Case cases[] = {
        {false, 0, {0}, 0},                                 // no modes
        {false, 0, {65}, 0},                                // too many
        {false, 0, {3}, 0},                                 // more than there is room for
        {false, 4, {0}, 4},                                 // no points
        {true, 4, {6}, 4},                                  // not those of the tree
        {false, 4, {3}, 0},                                 // more than there is room for
        {false, 8, {1}, 8},                                 // reserved
        {false, 16, {0, 0, 0, 0}, 16},                      // a range of 0
        {false, 16 + 3, {0xbf}, 16},                        // below 0
        {false, 32, {0, 0, 0x80, 0x7f}, 32},                // infinite
        {false, 20 + 3, {0xbf}, 20},                        // a step below 0
        {false, 24, {0, 0, 0, 0x3f}, 24},                   // it would grow too much
        {false, 28, {0, 0, 0xc0, 0x7f}, 28},                // not a number
        {false, motions + 16, {1}, motions + 16},           // a lane without a node
        {false, points, {0, 0, 0xc0, 0x7f}, points},        // a point that is none
        {false, points + 24 + 3, {0xff}, points + 24},      // a displacement beyond 2^74
        {true, points + 8, {0, 0, 0x80, 0x7f}, points + 8}, // infinite
    };
    for (const Case& c : cases) {
        Bytes bytes = kGolden[c.exact].bytes();
        const size_t begin = read(kGolden[c.exact].rest).size();
        const size_t content_begin = (begin + 63) / 64 * 64 + 64;
        for (size_t i = 0; i < c.bytes.size(); ++i) bytes[content_begin + c.at + i] = std::byte(c.bytes[i]);
        const auto tree = TreeView::open(bytes, {.check_hash = false});
        ASSERT_FALSE(tree) << c.at;
        EXPECT_EQ(tree.error().code, ErrorCode::bad_file) << c.at << ": " << tree.error().what;
        EXPECT_EQ(tree.error().where, content_begin + c.where) << c.at << ": " << tree.error().what;
    }
    Bytes twice = kGolden[0].bytes();
    format::append_section(twice, kDeformationKind, content(false));
    EXPECT_FALSE(TreeView::open(twice));
}

} // namespace
} // namespace prolate
