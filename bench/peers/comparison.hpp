// Compares libraries on pairs of meshes: the same poses, answers checked, all timed in turns.
#pragma once

#include "bench/peers/library.hpp"
#include "bench/peers/sweep.hpp"

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace prolate::bench::peers {

struct ComparisonOptions {
    size_t poses = 500;
    uint64_t seed = 1;
    double seconds = 0.5; ///< see SweepOptions
    std::string data;     ///< folder of meshes
    std::string python;   ///< interpreter that has V-HACD
};

/// What is timed together: all libraries at one kind of poses of one pair of meshes.
struct Subject {
    Query query;
    std::string a, b;         ///< names of models, or paths
    std::string kind;         ///< far, near, touching; near-aligned, ...
    uint32_t leaves = 0;      ///< of the proxy trees
    std::string name() const; ///< collide/horse-bunny/near, collide-again/..., collide-proxy/horse-horse/near-64
};

/// What came out for one library.
struct Outcome {
    std::string library;
    Timing timing;
    std::optional<double> volume_tests, triangle_tests; ///< a query, on average
    size_t wrong = 0;                                   ///< answers that are not those of the reference
};

struct Memory {
    std::string model, library;
    size_t triangles, bytes;
};

class Comparison {
public:
    Comparison(ComparisonOptions options, Libraries libraries);

    const Libraries& libraries() const { return libraries_; }
    /// Names of the libraries that answer the subject's query.
    std::vector<std::string> able(const Subject& subject);
    /// False if one of the meshes cannot be had; the reason is printed once.
    bool available(const Subject& subject);
    /// Runs the libraries called `names`, which are able to. Prints whose answers are wrong.
    std::vector<Outcome> run(const Subject& subject, const std::vector<std::string>& names);
    /// Bytes of the models in the libraries that built them and tell.
    std::vector<Memory> memory() const;

private:
    struct Entry {
        std::optional<Model> model;
        std::unique_ptr<Reference> reference;
        struct Built {
            std::unique_ptr<Shape> shape; // null if the library cannot
            size_t bytes;
        };
        std::map<std::string, Built> shapes; // by form
    };
    Entry& entry(const std::string& name);
    const Libraries& libraries_for(const Subject& subject);
    const Shape* shape(const std::string& model, const Library& library);
    bool reference_meets(const Subject& subject, const Placement& at);
    const std::vector<Placement>& poses(const Subject& subject);
    std::vector<double> expected_distances(const Subject& subject, std::span<const std::unique_ptr<Scene>> scenes);
    std::vector<Contact> expected_contacts(const Subject& subject);
    struct Truth {
        std::vector<double> distances;
        std::vector<Contact> contacts;
    };
    void judge(const Subject& subject, Scene& scene, const Truth& truth, Outcome& outcome);

    ComparisonOptions options_;
    Libraries libraries_;
    std::map<uint32_t, Libraries> proxies_; // by leaves
    std::map<std::string, Entry> models_;
    std::map<std::string, PoseSets> poses_;               // by pair, whether aligned, and leaves
    std::map<std::string, std::vector<Placement>> moved_; // by name of the subject
};

/// The name that a model goes by: without folder and extension.
std::string model_name(const std::string& path_or_name);

} // namespace prolate::bench::peers
