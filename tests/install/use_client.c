/* carom::client: where nothing listens the client says so, and that is no crash. */
#include <carom/client.h>

#include <stdio.h>
#include <string.h>

int main(void)
{
    carom_client *client = carom_client_create();
    carom_client_code code;
    int said;

    if (!client) return 1;
    code = carom_client_connect(client, "tcpq://127.0.0.1:1", NULL); /* tcpmux: long unused */
    said = strlen(carom_client_error(client)) > 0;
    printf("%d: %s\n", (int)code, carom_client_error(client));
    carom_client_destroy(client);
    return !(code == CAROM_CLIENT_E_NETWORK && said);
}
