// The section SKIN, beside DFRM: golden bytes, and what they decode to. The expected numbers are those of
// src/FORMAT.md.
#include "src/bytes.hpp"
#include "src/deformation.hpp"
#include "src/format.hpp"
#include "src/skin.hpp"

#include <prolate/tree.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace prolate {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;

Bytes read(const std::string& name) {
    std::ifstream in(fs::path(PROLATE_TEST_DATA) / name, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(in)), {});
    const auto* const data = reinterpret_cast<const std::byte*>(text.data());
    return {data, data + text.size()};
}

class Content {
public:
    template <class... T> void put(T... values) { (put_one(values), ...); }
    const Bytes& bytes() const { return bytes_; }

private:
    template <class T> void put_one(T value) {
        bytes_.resize(bytes_.size() + sizeof value);
        store_le(bytes_.data() + bytes_.size() - sizeof value, value);
    }
    Bytes bytes_;
};

// One mode; motions that tell slots and kinds apart.
Bytes deformation_of(const TreeView& tree) {
    const bool exact = tree.has_triangles();
    const uint32_t points = exact ? tree.vertex_count() : 2;
    Content out;
    out.put(uint32_t{1}, points, uint64_t{0}, 0.5f, 0.25f, 0.0625f, 0.125f);
    for (uint32_t slot = 0; slot < tree.slot_count(); ++slot) {
        const auto k = static_cast<int16_t>(tree.is_node(slot) ? slot + 1 : 0);
        const uint16_t kind = k != 0 && slot % 2 == 1 ? kIsRadius : 0;
        out.put(k, static_cast<int16_t>(-k), int16_t{0}, static_cast<uint16_t>(kind | k));
    }
    for (uint32_t p = 0; !exact && p < points; ++p) out.put(1.0f, 2.0f, static_cast<float>(p));
    for (uint32_t p = 0; p < points; ++p) out.put(0.0f, 0.25f, static_cast<float>(p));
    return out.bytes();
}

// Three bones, of which two move each node and each point.
Bytes skin_of(const TreeView& tree) {
    const bool exact = tree.has_triangles();
    const uint32_t points = exact ? tree.vertex_count() : 2;
    Content out;
    out.put(uint32_t{3}, points, uint32_t{2}, 2 * tree.node_count(), uint64_t{0});
    uint32_t before = 0;
    out.put(before);
    for (uint32_t slot = 0; slot < tree.slot_count(); ++slot) out.put(before += tree.is_node(slot) ? 2 : 0);
    for (uint16_t node = 0; node < tree.node_count(); ++node) {
        out.put(uint16_t{0}, static_cast<uint16_t>(0x6000 - node), uint16_t{0x100}, uint16_t{0});
        out.put(1.0f, 2.0f, 3.0f, 0.5f);
        out.put(uint16_t{2}, static_cast<uint16_t>(0x2000 + node), uint16_t{0x8000}, uint16_t{0});
        out.put(-1.0f, -2.0f, -3.0f, static_cast<float>(node));
    }
    for (uint32_t p = 0; !exact && p < points; ++p) out.put(1.0f, 2.0f, static_cast<float>(p));
    for (uint32_t p = 0; p < points; ++p) out.put(0.75f, 0.25f, uint16_t{2}, static_cast<uint16_t>(p % 2));
    return out.bytes();
}

Bytes moving(const char* at_rest) {
    Bytes out = read(at_rest);
    const auto tree = TreeView::open(out);
    const Bytes modes = deformation_of(*tree), bones = skin_of(*tree);
    format::append_section(out, kDeformationKind, modes);
    format::append_section(out, kSkinKind, bones);
    return out;
}

constexpr std::pair<const char*, const char*> kFiles[] = {{"golden_v8.etree", "golden_v9_skin.etree"},
                                                          {"golden_v8_exact.etree", "golden_v9_skin_exact.etree"}};

// PROLATE_WRITE_GOLDEN=1 writes them anew, for a new version.
TEST(SkinFormat, GoldenFiles) {
    for (const auto& [at_rest, name] : kFiles) {
        const Bytes now = moving(at_rest);
        if (std::getenv("PROLATE_WRITE_GOLDEN") != nullptr) {
            EXPECT_TRUE(save((fs::path(PROLATE_TEST_DATA) / name).c_str(), now));
        }
        const Bytes file = read(name);
        EXPECT_EQ(file, now);
        const auto tree = TreeView::open(file);
        ASSERT_TRUE(tree) << tree.error().what;
        EXPECT_EQ(tree->format_version(), 9);
        const auto modes = tree->deformation();
        ASSERT_TRUE(modes);
        EXPECT_EQ(modes->mode_count(), 1u);
        EXPECT_EQ(modes->range(0), 0.5f);
        EXPECT_EQ(modes->displacement(1, 0), (Vec3{0, 0.25f, 1}));
        const auto skin = tree->skin();
        ASSERT_TRUE(skin);
        EXPECT_EQ(skin->bone_count(), 3u);
        EXPECT_EQ(skin->weight_count(), 2u);
        uint32_t node = 0;
        tree->for_each_node([&](uint32_t slot) {
            const Deformation::Motion motion = modes->motion(slot, 0);
            EXPECT_EQ(motion.shift[0], 0.25 * (slot + 1));
            EXPECT_EQ(motion.shift[1], -0.25 * (slot + 1));
            EXPECT_EQ(motion.growth, slot % 2 == 0 ? 0.0625 * (slot + 1) : 0);
            EXPECT_EQ(motion.radius, slot % 2 == 1 ? 0.125 * (slot + 1) : 0);
            ASSERT_EQ(skin->influence_count(slot), 2u);
            const Skin::Influence first = skin->influence(slot, 0), second = skin->influence(slot, 1);
            EXPECT_EQ(first.bone, 0u);
            EXPECT_EQ(first.weight, 0.75 - node * 0x1p-15);
            EXPECT_EQ(first.spread, 0x1p-7);
            EXPECT_EQ(first.center[2], 3);
            EXPECT_EQ(second.bone, 2u);
            EXPECT_EQ(second.weight, 0.25 + node * 0x1p-15);
            EXPECT_EQ(second.spread, 1);
            EXPECT_EQ(second.radius, node);
            ++node;
        });
        EXPECT_EQ(skin->weight(1, 0).bone, 2u);
        EXPECT_EQ(skin->weight(1, 0).weight, 0.75f);
        EXPECT_EQ(skin->weight(1, 1).bone, 1u);
        if (tree->has_triangles()) continue;
        EXPECT_EQ(skin->point_count(), 2u);
        EXPECT_EQ(skin->point(1), (Vec3{1, 2, 1}));
        EXPECT_FALSE(tree->coarser(0).skin()); // prefixes have no sections
    }
}

// What open() says of bytes that are wrong, each by itself.
TEST(SkinFormat, WrongSkinsAreRefused) {
    const Bytes file = moving("golden_v8.etree");
    const auto whole = TreeView::open(file);
    const auto content = whole->section(1).content;
    const auto begin = static_cast<size_t>(content.data() - whole->bytes().data());
    const auto nodes = static_cast<size_t>(influences_begin(whole->slot_count()));
    const auto points = static_cast<size_t>(skin_points_begin(whole->slot_count(), 2 * whole->node_count()));
    const auto error = [&](size_t at, auto value) {
        Bytes bytes = file;
        store_le(bytes.data() + begin + at, value);
        const auto tree = TreeView::open(bytes, {.check_hash = false});
        return tree ? std::string() : std::string(tree.error().what);
    };
    const auto has = [](const std::string& text, const char* words) { return text.find(words) != text.npos; };
    EXPECT_TRUE(has(error(kBoneCount, uint32_t{0}), "1 to 1024 bones"));
    EXPECT_TRUE(has(error(kBoneCount, uint32_t{1025}), "1 to 1024 bones"));
    EXPECT_TRUE(has(error(kBoneCount, uint32_t{2}), "a bone twice, or one that does not exist"));
    EXPECT_TRUE(has(error(kSkinPointCount, uint32_t{0}), "other points"));
    EXPECT_TRUE(has(error(kSkinPointCount, UINT32_MAX), "wrong size"));
    EXPECT_TRUE(has(error(kSkinWeightCount, uint32_t{9}), "1 to 8 weights"));
    EXPECT_TRUE(has(error(kSkinInfluenceCount, UINT32_MAX), "wrong size"));
    EXPECT_TRUE(has(error(kSkinZeros, uint32_t{1}), "reserved"));
    EXPECT_TRUE(has(error(kFirstInfluences, uint32_t{1}), "share out"));
    EXPECT_TRUE(has(error(kFirstInfluences + 4, UINT32_MAX), "share out"));
    EXPECT_TRUE(has(error(nodes + kInfluenceBone, uint16_t{2}), "a bone twice"));
    EXPECT_TRUE(has(error(nodes + kInfluenceWeight, uint16_t{7}), "add up to 1"));
    EXPECT_TRUE(has(error(nodes + kInfluenceSpread, uint16_t{0x8001}), "spread"));
    EXPECT_TRUE(has(error(nodes + kInfluenceZeros, uint16_t{1}), "reserved"));
    EXPECT_TRUE(has(error(nodes + kInfluenceCenter, HUGE_VALF), "center"));
    EXPECT_TRUE(has(error(nodes + kInfluenceRadius, -1.0f), "radius"));
    EXPECT_TRUE(has(error(points, HUGE_VALF), "not finite"));
    EXPECT_TRUE(has(error(points, 1.5f), "other points than the deformation's"));
    EXPECT_TRUE(has(error(points + 24, 9.0f), "add up to about 1"));
    EXPECT_TRUE(has(error(points + 24, -1.0f), "below 0"));
    EXPECT_TRUE(has(error(points + 32, uint16_t{3}), "names a bone that does not exist"));
    Bytes twice = file;
    format::append_section(twice, kSkinKind, content);
    EXPECT_TRUE(has(TreeView::open(twice).error().what, "two skins"));
}

} // namespace
} // namespace prolate
