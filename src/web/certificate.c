#include "web/certificate.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include "web/access.h"

enum {
    DAY_S = 24 * 3600,
    DAYS = 825,
    NAMES_BYTES = 64 + FV_WEB_NAMES_MAX * (FV_WEB_NAME_BYTES + 8)
};

/* ---- check ----------------------------------------------------------------------------------- */

static enum fovea_status wrong(struct fovea_error *error, const char *option, const char *file,
                               const char *found, const char *expected)
{
    ERR_clear_error();
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: %.300s: found %s, expected %s", option,
                           file, found, expected);
}

/* An ordinary file that can be read, or why not. */
static FILE *open_file(const char *path, mode_t forbidden, const char **found)
{
    struct stat status;
    const int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (file < 0 || fstat(file, &status) != 0)
        *found = strerror(errno);
    else if (!S_ISREG(status.st_mode))
        *found = "no ordinary file";
    else if (status.st_mode & forbidden)
        *found = "a file that everybody may use (chmod 600 remedies that)";
    else
        return fdopen(file, "r");
    if (file >= 0) close(file);
    return NULL;
}

/* Whether the library takes them: it also reads those behind the first, and has its own bounds. */
static bool is_served(const struct fv_web_certificate *certificate)
{
    SSL_CTX *context = SSL_CTX_new(TLS_server_method());
    const bool served =
        context != NULL && SSL_CTX_use_certificate_chain_file(context, certificate->file) == 1 &&
        SSL_CTX_use_PrivateKey_file(context, certificate->key_file, SSL_FILETYPE_PEM) == 1;
    SSL_CTX_free(context);
    return served;
}

enum fovea_status fv_web_certificate_check(const struct fv_web_certificate *certificate,
                                           struct fovea_error *error)
{
    static const char *const of_certificate = "a certificate in PEM",
                             *const of_key =
                                 "a key in PEM, without a password, for its owner alone";
    const char *found = "something else";
    FILE *file = open_file(certificate->file, 0, &found);
    X509 *read = file != NULL ? PEM_read_X509(file, NULL, NULL, NULL) : NULL;
    if (file != NULL) fclose(file);
    if (read == NULL)
        return wrong(error, "--certificate", certificate->file, found, of_certificate);
    found = "something else";
    file = open_file(certificate->key_file, S_IRWXO, &found);
    static char no_password[] = "";
    EVP_PKEY *key = file != NULL ? PEM_read_PrivateKey(file, NULL, NULL, no_password) : NULL;
    if (file != NULL) fclose(file);
    const bool fits = key != NULL && X509_check_private_key(read, key) == 1,
               served = fits && is_served(certificate);
    X509_free(read);
    EVP_PKEY_free(key);
    if (key == NULL) return wrong(error, "--certificate-key", certificate->key_file, found, of_key);
    if (!fits)
        return wrong(error, "--certificate-key", certificate->key_file,
                     "the key of another certificate", "that of the file of --certificate");
    if (!served)
        return wrong(error, "--certificate", certificate->file, "what OpenSSL does not serve",
                     "keys of 2,048 bits (RSA) or 256 (EC) at least, and whole certificates behind "
                     "the first");
    return FOVEA_OK;
}

/* ---- make ------------------------------------------------------------------------------------ */

static bool extend(X509 *made, int kind, const char *value)
{
    X509_EXTENSION *extension = X509V3_EXT_conf_nid(NULL, NULL, kind, value);
    const bool added = extension != NULL && X509_add_ext(made, extension, -1) == 1;
    X509_EXTENSION_free(extension);
    return added;
}

/* The hosts that it is for, as X.509's subjectAltName has them. */
static bool write_hosts(char text[NAMES_BYTES], const char *const *names, int count,
                        const char *address)
{
    size_t used = (size_t)snprintf(text, NAMES_BYTES, "DNS:localhost,IP:127.0.0.1");
    if (strcmp(address, "0.0.0.0") != 0 && strcmp(address, "127.0.0.1") != 0)
        used += (size_t)snprintf(text + used, NAMES_BYTES - used, ",IP:%s", address);
    for (int i = 0; i < count; i++) {
        static const char letters[] = "abcdefghijklmnopqrstuvwxyz"
                                      "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-";
        struct in_addr number;
        const size_t length = strlen(names[i]);
        if (length == 0 || length >= FV_WEB_NAME_BYTES ||
            names[i][strspn(names[i], letters)] != '\0')
            return false;
        used +=
            (size_t)snprintf(text + used, NAMES_BYTES - used, ",%s:%s",
                             inet_pton(AF_INET, names[i], &number) == 1 ? "IP" : "DNS", names[i]);
    }
    return true;
}

static X509 *sign(EVP_PKEY *key, const char *hosts)
{
    X509 *made = X509_new();
    BIGNUM *serial = BN_new();
    static const char name[] = "Fovea";
    const bool done = made != NULL && serial != NULL && X509_set_version(made, 2) == 1 &&
                      BN_rand(serial, 127, BN_RAND_TOP_ANY, BN_RAND_BOTTOM_ANY) == 1 &&
                      BN_to_ASN1_INTEGER(serial, X509_get_serialNumber(made)) != NULL &&
                      X509_gmtime_adj(X509_getm_notBefore(made), -DAY_S) != NULL &&
                      X509_gmtime_adj(X509_getm_notAfter(made), (long)(DAYS - 1) * DAY_S) != NULL &&
                      X509_set_pubkey(made, key) == 1 &&
                      X509_NAME_add_entry_by_txt(X509_get_subject_name(made), "CN", MBSTRING_ASC,
                                                 (const unsigned char *)name, -1, -1, 0) == 1 &&
                      X509_set_issuer_name(made, X509_get_subject_name(made)) == 1 &&
                      extend(made, NID_basic_constraints, "critical,CA:FALSE") &&
                      extend(made, NID_key_usage, "critical,digitalSignature") &&
                      extend(made, NID_ext_key_usage, "serverAuth") &&
                      extend(made, NID_subject_alt_name, hosts) &&
                      X509_sign(made, key, EVP_sha256()) > 0;
    BN_free(serial);
    if (done) return made;
    X509_free(made);
    return NULL;
}

/* A new file; closed by finish, which has it on the disk. */
static FILE *create(const char *path, mode_t mode)
{
    const int file = open(path, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode);
    return file >= 0 ? fdopen(file, "w") : NULL;
}

static bool finish(FILE *file, const char *path, bool written)
{
    const bool kept = written && fflush(file) == 0 && fsync(fileno(file)) == 0;
    const bool closed = fclose(file) == 0;
    if (!kept || !closed) unlink(path);
    return kept && closed;
}

/* The key of the file, or a new one, which is written there; NULL: neither. */
static EVP_PKEY *key_of(const char *path)
{
    static char no_password[] = "";
    const char *found;
    FILE *file = open_file(path, S_IRWXO, &found);
    EVP_PKEY *key = file != NULL ? PEM_read_PrivateKey(file, NULL, NULL, no_password) : NULL;
    if (file != NULL) {
        fclose(file);
        return key;
    }
    file = create(path, 0600);
    if (file == NULL) return NULL;
    key = EVP_EC_gen("P-256");
    if (finish(file, path,
               key != NULL && PEM_write_PrivateKey(file, key, NULL, NULL, 0, NULL, NULL) == 1))
        return key;
    EVP_PKEY_free(key);
    return NULL;
}

enum fovea_status fv_web_certificate_make(const struct fv_web_certificate *certificate,
                                          const char *const *names, int name_count,
                                          const char *address, bool *made,
                                          struct fovea_error *error)
{
    char hosts[NAMES_BYTES];
    struct stat status;
    *made = false;
    if (stat(certificate->file, &status) == 0 || errno != ENOENT)
        return FOVEA_OK; /* the check says what is there */
    if (name_count > FV_WEB_NAMES_MAX || !write_hosts(hosts, names, name_count, address))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "--make-certificate: found a --name that is none of a host, "
                               "expected letters, digits, dots and hyphens");
    errno = 0;
    EVP_PKEY *key = key_of(certificate->key_file);
    X509 *signed_by_itself = key != NULL ? sign(key, hosts) : NULL;
    FILE *file = signed_by_itself != NULL ? create(certificate->file, 0644) : NULL;
    *made = file != NULL &&
            finish(file, certificate->file, PEM_write_X509(file, signed_by_itself) == 1);
    const int reason = errno;
    X509_free(signed_by_itself);
    EVP_PKEY_free(key);
    ERR_clear_error();
    if (*made) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "--make-certificate: %.200s and %.200s: found no way to make them (%s), "
                           "expected a folder of this user, and no other key there",
                           certificate->file, certificate->key_file,
                           reason != 0 ? strerror(reason) : "libcrypto refuses it");
}
