// "prolate compare": its figures are those of the files that "bake" writes, and its picture is a PNG file.
#include "tests/cli/command.hpp"

#include <nlohmann/json.hpp>

namespace prolate {
namespace {

using Json = nlohmann::json;

TEST_F(Cli, CompareTellsTheFiguresOfBake) {
    const std::string mesh = file("peanut.obj", obj_text(peanut(6)));
    const Outcome o = run({"compare", mesh, "-o", file("choices.png"), "--quality", "fast", "--json"});
    ASSERT_EQ(o.code, 0) << o.err;
    const Json choices = Json::parse(o.out)["choices"];
    ASSERT_EQ(choices.size(), 6u);
    for (size_t i = 0; i < 5; ++i) {
        const Json& choice = choices[i];
        const auto name = choice["name"].get<std::string>();
        SCOPED_TRACE(name);
        const std::string primitive = name.ends_with(" spheres") ? "sphere" : "ellipsoid";
        const Outcome baked =
            run({"bake", mesh, "-o", file("tree.etree"), "--force", "--quality", "fast", "--primitive", primitive,
                 "--ellipsoids", name.substr(0, name.find(' ')), "--report", file("report.json")});
        ASSERT_EQ(baked.code, 0) << baked.err;
        const Json leaves = Json::parse(read(file("report.json")))["levels"].back();
        EXPECT_NEAR(choice["outside_ratio"], leaves["outside_ratio"], 1e-6);
        EXPECT_NEAR(choice["clearance"], leaves["hausdorff_max"], 1e-6);
        EXPECT_EQ(choice["bytes"], fs::file_size(file("tree.etree")));
        EXPECT_GT(choice["nanoseconds"], 0);
    }
    EXPECT_EQ(choices[5]["name"], "1 convex hull");
    EXPECT_GT(choices[5]["outside_ratio"], 0.01) << "the peanut has a waist";

    const std::string png = read(file("choices.png"));
    EXPECT_TRUE(png.starts_with("\x89PNG\r\n\x1a\n"));
    EXPECT_NE(png.find("IEND"), std::string::npos) << "whole";
}

TEST_F(Cli, CompareFindsTheHullOfACubeExact) {
    const std::string mesh = file("cube.obj", obj_text(cube()));
    const Outcome o = run({"compare", mesh, "--quality", "fast", "--json"});
    ASSERT_EQ(o.code, 0) << o.err;
    const Json hull = Json::parse(o.out)["choices"].back();
    EXPECT_EQ(hull["name"], "1 convex hull");
    EXPECT_NEAR(hull["outside_ratio"], 0, 1e-4) << "as far as columns measure the solid's volume";
    EXPECT_LT(hull["clearance_percent"], 0.5) << "an upper bound, of so many parts of the surface";
    EXPECT_EQ(listing(), std::vector<std::string>{"cube.obj"}) << "no picture that nobody asked for";
}

} // namespace
} // namespace prolate
